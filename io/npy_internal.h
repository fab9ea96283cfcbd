#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "io/npz.h"

namespace sole::io {

/// Bytes of one element of a dtype that NpyArray knows; 0 for any other.
std::size_t ItemSize(const std::string& dtype);

/// One .npy file from memory; `where` starts every message.
NpyArray ParseNpy(std::span<const std::uint8_t> file, const std::string& where);

/// The bytes of a .npy file (format 1.0). Throws Error if `bytes` does not match dtype and shape.
std::vector<std::uint8_t> FormatNpy(const NpyArray& array, const std::string& where);

}  // namespace sole::io
