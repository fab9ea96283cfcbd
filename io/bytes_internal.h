#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

namespace sole::io {

static_assert(std::endian::native == std::endian::little,
              "Sole's file code expects a little-endian host");

/// Little-endian value at `offset`; the caller has checked that it lies inside.
template <typename T>
T LoadLittle(const void* bytes, std::size_t offset = 0) {
  T value;
  std::memcpy(&value, static_cast<const char*>(bytes) + offset, sizeof value);
  return value;
}

template <typename T>
void StoreLittle(void* bytes, std::size_t offset, const T& value) {
  std::memcpy(static_cast<char*>(bytes) + offset, &value, sizeof value);
}

template <typename T>
void AppendLittle(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// Reverses the bytes of every element of `size` bytes.
inline void SwapElements(std::span<std::uint8_t> bytes, std::size_t size) {
  for (std::size_t i = 0; i + size <= bytes.size(); i += size) {
    std::reverse(bytes.begin() + static_cast<std::ptrdiff_t>(i),
                 bytes.begin() + static_cast<std::ptrdiff_t>(i + size));
  }
}

/// CRC-32 as zip, PNG and zlib know it.
std::uint32_t Crc32(const void* bytes, std::size_t size, std::uint32_t start = 0);

}  // namespace sole::io
