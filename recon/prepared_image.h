#pragma once

#include <Eigen/Core>

#include "core/image.h"

namespace sole::recon {

/// An image ready for subset matching: coefficients of its cubic B-spline, so that grey levels and
/// gradients can be read at pixels and between them.
struct PreparedImage {
  ImageF coefficients;
};

/// Throws Error for images of fewer than 16 x 16 pixels. With a `mask` of the same size only the
/// surroundings of its non-zero pixels, 32 pixels wide at least, are good for anything.
PreparedImage Prepare(const ImageU8& image, const ImageU8* mask = nullptr);
/// The same for grey levels of any depth, scaled to 0 to 255.
PreparedImage Prepare(ImageF grey);

/// Grey level at a position by cubic B-spline; NaN within 2 pixels of the border.
double GreyAt(const PreparedImage& image, const Eigen::Vector2d& position_px);

}  // namespace sole::recon
