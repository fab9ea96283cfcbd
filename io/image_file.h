#pragma once

#include <filesystem>

#include "core/image.h"

namespace sole::io {

/// 8-bit grey image in any format OpenCV reads; colour is converted. Throws Error with the path.
ImageU8 ReadImage(const std::filesystem::path& path);
/// Writes atomically; the format follows the extension (png, jpg, tiff).
void WriteImage(const std::filesystem::path& path, const ImageU8& image);

}  // namespace sole::io
