#include "sim/gige/chunk_data.h"

#include <bit>

#include "sim/gige/big_endian.h"

namespace sole::sim {
namespace {

constexpr std::uint32_t kTagSize = 8;

}  // namespace

std::uint32_t ChunkDataSize(std::uint32_t mask) {
  std::uint32_t size = kTagSize;
  for (std::uint32_t kind = 0; kind < kChunks.size(); ++kind) {
    if ((mask >> kind & 1) != 0) size += kChunks[kind].length + kTagSize;
  }
  return size;
}

std::vector<std::uint8_t> ChunkData(std::uint32_t mask, std::uint32_t image_size,
                                    const ChunkValues& values) {
  std::vector<std::uint8_t> bytes(ChunkDataSize(mask), 0);
  std::size_t at = 0;
  const auto tag = [&](std::uint32_t id, std::uint32_t length) {
    Store32(bytes, at, id);
    Store32(bytes, at + 4, length);
    at += kTagSize;
  };
  tag(kImageChunkId, image_size);
  for (std::uint32_t kind = 0; kind < kChunks.size(); ++kind) {
    if ((mask >> kind & 1) == 0) continue;
    if (kind == kChunkFrameId) Store64(bytes, at, values.frame_id);
    if (kind == kChunkTimestamp) Store64(bytes, at, values.timestamp_ns);
    if (kind == kChunkExposureTime)
      Store64(bytes, at, std::bit_cast<std::uint64_t>(values.exposure_us));
    if (kind == kChunkLineStatusAll) Store32(bytes, at, values.lines);
    if (kind == kChunkTriggerSequence)
      Store64(bytes, at, static_cast<std::uint64_t>(values.trigger_sequence));
    at += kChunks[kind].length;
    tag(kChunks[kind].id, kChunks[kind].length);
  }
  return bytes;
}

}  // namespace sole::sim
