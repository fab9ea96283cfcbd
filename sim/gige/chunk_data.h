#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace sole::sim {

/// Chunks that a camera can append to its frames; bit 1 << n of a mask stands for the chunk that
/// ChunkSelector calls n.
enum ChunkKind : std::uint32_t {
  kChunkFrameId = 0,
  kChunkTimestamp = 1,
  kChunkExposureTime = 2,
  kChunkLineStatusAll = 3,
  kChunkTriggerSequence = 4,
};

struct ChunkInfo {
  const char* name;  ///< entry of ChunkSelector; the value's feature is "Chunk" + name
  std::uint32_t id;
  std::uint32_t length;  ///< bytes
};

/// By ChunkKind.
inline constexpr std::array<ChunkInfo, 5> kChunks = {{{"FrameID", 0x5001, 8},
                                                      {"Timestamp", 0x5002, 8},
                                                      {"ExposureTime", 0x5003, 8},
                                                      {"LineStatusAll", 0x5004, 4},
                                                      {"TriggerSequence", 0x5005, 8}}};
inline constexpr std::uint32_t kImageChunkId = 0x5000;

struct ChunkValues {
  std::uint16_t frame_id = 0;
  std::uint64_t timestamp_ns = 0;
  double exposure_us = 0;
  std::uint32_t lines = 0;            ///< bit 0 Line1, bit 1 Line2
  std::int64_t trigger_sequence = 0;  ///< of the exposure that the image shows
};

/// Bytes that chunk mode with `mask` adds to a frame.
std::uint32_t ChunkDataSize(std::uint32_t mask);

/// What follows the pixels: the image's own tag, then each chunk's value and tag (id, length). Tags
/// are read from the end backwards.
std::vector<std::uint8_t> ChunkData(std::uint32_t mask, std::uint32_t image_size,
                                    const ChunkValues& values);

}  // namespace sole::sim
