#pragma once

#include <string>

#include "core/image.h"

namespace sole::io {

/// Portable float map (Debevec): "Pf" or "PF", width, height, scale (negative: little endian), then
/// rows of floats from the bottom up.
bool IsPfm(const std::string& content);
/// Colour is converted to grey. Throws Error with `where` if header or length are wrong.
ImageF DecodePfm(const std::string& content, const std::string& where);
/// Grey, little endian; pixels that are not finite become infinity.
std::string EncodePfm(const ImageF& image);

}  // namespace sole::io
