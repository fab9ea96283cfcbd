#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace sole::sim {

/// Big-endian integers in byte buffers, as GigE Vision sends them. No bounds checks beyond the
/// span's.
inline std::uint16_t Load16(std::span<const std::uint8_t> bytes, std::size_t at) {
  return static_cast<std::uint16_t>((bytes[at] << 8) | bytes[at + 1]);
}
inline std::uint32_t Load32(std::span<const std::uint8_t> bytes, std::size_t at) {
  return (static_cast<std::uint32_t>(Load16(bytes, at)) << 16) | Load16(bytes, at + 2);
}
inline std::uint64_t Load64(std::span<const std::uint8_t> bytes, std::size_t at) {
  return (static_cast<std::uint64_t>(Load32(bytes, at)) << 32) | Load32(bytes, at + 4);
}
inline void Store16(std::span<std::uint8_t> bytes, std::size_t at, std::uint16_t value) {
  bytes[at] = static_cast<std::uint8_t>(value >> 8);
  bytes[at + 1] = static_cast<std::uint8_t>(value);
}
inline void Store32(std::span<std::uint8_t> bytes, std::size_t at, std::uint32_t value) {
  Store16(bytes, at, static_cast<std::uint16_t>(value >> 16));
  Store16(bytes, at + 2, static_cast<std::uint16_t>(value));
}
inline void Store64(std::span<std::uint8_t> bytes, std::size_t at, std::uint64_t value) {
  Store32(bytes, at, static_cast<std::uint32_t>(value >> 32));
  Store32(bytes, at + 4, static_cast<std::uint32_t>(value));
}

}  // namespace sole::sim
