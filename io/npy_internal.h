#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "io/npz.h"

namespace sole::io {

/// Bytes of one element of a dtype that NpyArray knows; 0 for any other.
std::size_t ItemSize(const std::string& dtype);

/// What the header of an .npy file says.
struct NpyHeader {
  std::string descr;  ///< dtype with byte order, as in the file
  bool fortran = false;
  std::vector<std::size_t> shape;
  std::size_t data_offset = 0;  ///< where the data begin

  bool HoldsObjects() const { return descr == "O" || descr == "|O"; }
};
NpyHeader ParseNpyHeader(std::span<const std::uint8_t> file, const std::string& where);

/// Array of `data`, which must fill the header's shape; turned into C order and little endian.
NpyArray ArrayFrom(NpyHeader header, std::span<const std::uint8_t> data, const std::string& where);

/// One .npy file from memory; `where` starts every message.
NpyArray ParseNpy(std::span<const std::uint8_t> file, const std::string& where);

/// The bytes of a .npy file (format 1.0). Throws Error if `bytes` does not match dtype and shape.
std::vector<std::uint8_t> FormatNpy(const NpyArray& array, const std::string& where);

}  // namespace sole::io
