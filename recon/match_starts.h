#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>

#include "recon/rectify.h"
#include "recon/subset.h"

namespace sole::recon {

/// Sub-pixel match of one left pixel.
struct PixelMatch {
  Eigen::Vector2i left_px;
  SubsetMatch match;
};

/// Start of a left pixel's match; empty where nothing is known. Called from several threads.
using StartFunction = std::function<std::optional<SubsetWarp>(const Eigen::Vector2i& left_px)>;

/// Starts from the disparity (rectified pixels, NaN where unknown) and its slope within `radius_px`.
/// Both arguments must outlive the function.
StartFunction StartsFromDisparity(const Rectification& rectification, const ImageF& disparity,
                                  int radius_px);
/// The same for a pair that is rectified already: right x = left x - disparity, same row.
StartFunction StartsFromDisparity(const ImageF& disparity, int radius_px);

/// Starts at the warps of earlier matches of the same left pixels; `matches` must outlive the
/// function.
StartFunction StartsFromMatches(std::span<const PixelMatch> matches);

}  // namespace sole::recon
