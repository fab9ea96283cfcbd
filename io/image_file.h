#pragma once

#include <filesystem>
#include <span>

#include "core/image.h"

namespace sole::io {

/// 8-bit grey image in any format OpenCV reads; colour is converted. Throws Error with the path.
ImageU8 ReadImage(const std::filesystem::path& path);
/// Writes atomically; the format follows the extension (png, jpg, tiff).
void WriteImage(const std::filesystem::path& path, const ImageU8& image);

/// Grey image of any depth, levels as stored; colour is converted.
struct GreyImage {
  ImageF grey;
  int bits = 8;  ///< 8, 16, or 32 for floating point
};

/// 8 bit, 16 bit (10, 12 or 14 bit in them) and floating point: PNG, TIFF, PFM and what else OpenCV
/// reads. The content decides, not the extension. Throws Error with the path, also for NaN and
/// infinity.
GreyImage ReadGreyImage(const std::filesystem::path& path);

/// The level that counts as white in all of `images`: 255; of 16-bit files the smallest of 1023,
/// 4095, 16383 and 65535 that none exceeds; of floating point 1, or 255 or 65535 where 1 is exceeded.
double WhiteLevel(std::span<const GreyImage> images);

/// One 32-bit float per pixel, atomically: .pfm (unknown: infinity, as is the custom there) or
/// uncompressed .tif / .tiff (unknown: NaN). Non-finite pixels are unknown.
void WriteFloatImage(const std::filesystem::path& path, const ImageF& image);
/// Throws Error unless WriteFloatImage knows the extension.
void CheckFloatImageExtension(const std::filesystem::path& path);

}  // namespace sole::io
