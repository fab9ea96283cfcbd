#include "sim/gige/gvsp_packet.h"

#include <algorithm>

#include <fmt/format.h>

#include "core/error.h"
#include "sim/gige/big_endian.h"
#include "sim/gige/chunk_data.h"

namespace sole::sim {
namespace {

enum Format : std::uint32_t { kLeader = 1, kTrailer = 2, kPayload = 3 };
constexpr std::uint16_t kImagePayload = 1, kImageWithChunksPayload = 0x4001;

GvspPacket Header(GevStatus status, std::uint16_t frame_id, Format format,
                  std::uint32_t packet_id) {
  GvspPacket packet;
  Store16(packet.header, 0, static_cast<std::uint16_t>(status));
  Store16(packet.header, 2, frame_id);
  Store32(packet.header, 4, (format << 24) | (packet_id & 0xFFFFFF));
  packet.header_size = kGvspHeaderSize;
  return packet;
}

std::uint16_t PayloadType(const SentFrame& frame) {
  return frame.chunks.empty() ? kImagePayload : kImageWithChunksPayload;
}

std::size_t BlockSize(const SentFrame& frame) {
  return frame.settings.packet_size - kIpUdpHeaderSize - kGvspHeaderSize;
}

}  // namespace

void SetPixels(const ImageU8& image, SentFrame* frame) {
  const StreamSettings& s = frame->settings;
  const auto width = static_cast<std::uint32_t>(image.width),
             height = static_cast<std::uint32_t>(image.height);
  if (s.offset_x + s.width > width || s.offset_y + s.height > height) {
    throw Error(fmt::format(
        "the provided image of {} x {} pixels does not cover the region {} x {} at ({}, {})", width,
        height, s.width, s.height, s.offset_x, s.offset_y));
  }
  if (s.width == width && s.height == height) {
    frame->pixels = image.pixels;
    return;
  }
  frame->cropped.clear();
  for (std::uint32_t y = 0; y < s.height; ++y) {
    const auto row = image.Row(static_cast<int>(s.offset_y + y)).subspan(s.offset_x, s.width);
    frame->cropped.insert(frame->cropped.end(), row.begin(), row.end());
  }
  frame->pixels = frame->cropped;
}

void SetChunks(std::int64_t trigger_sequence, SentFrame* frame) {
  const StreamSettings& s = frame->settings;
  frame->chunks.clear();
  if (!s.chunk_mask) return;
  frame->chunks = ChunkData(*s.chunk_mask, static_cast<std::uint32_t>(frame->pixels.size()),
                            {.frame_id = frame->id,
                             .timestamp_ns = s.timestamp_ns,
                             .exposure_us = s.exposure_us,
                             .lines = s.lines,
                             .trigger_sequence = trigger_sequence});
}

std::uint32_t PacketCount(const SentFrame& frame) {
  const std::size_t block = BlockSize(frame);
  const std::size_t size = frame.pixels.size() + frame.chunks.size();
  return static_cast<std::uint32_t>((size + block - 1) / block) + 2;
}

GvspPacket MakePacket(const SentFrame& frame, std::uint32_t id, GevStatus status) {
  const StreamSettings& s = frame.settings;
  if (id == 0) {
    GvspPacket leader = Header(status, frame.id, kLeader, id);
    Store16(leader.header, 10, PayloadType(frame));
    Store64(leader.header, 12, s.timestamp_ns);
    Store32(leader.header, 20, kMono8);
    Store32(leader.header, 24, s.width);
    Store32(leader.header, 28, s.height);
    Store32(leader.header, 32, s.offset_x);
    Store32(leader.header, 36, s.offset_y);
    leader.header_size = 44;
    return leader;
  }
  if (id + 1 == PacketCount(frame)) {
    GvspPacket trailer = Header(status, frame.id, kTrailer, id);
    Store16(trailer.header, 10, PayloadType(frame));
    Store32(trailer.header, 12, s.height);
    trailer.header_size = 16;
    if (!frame.chunks.empty()) {
      Store32(trailer.header, 16,
              static_cast<std::uint32_t>(frame.pixels.size() + frame.chunks.size()));
      trailer.header_size = 24;  // With the layout id, which is 0.
    }
    return trailer;
  }
  GvspPacket payload = Header(status, frame.id, kPayload, id);
  const std::size_t begin = (id - 1) * BlockSize(frame);
  const std::size_t end =
      std::min(begin + BlockSize(frame), frame.pixels.size() + frame.chunks.size());
  const std::size_t split = std::clamp(frame.pixels.size(), begin, end);
  if (split > begin) payload.pixels = frame.pixels.subspan(begin, split - begin);
  if (end > split)
    payload.chunks = std::span(frame.chunks).subspan(split - frame.pixels.size(), end - split);
  return payload;
}

GvspPacket MakeUnavailable(std::uint16_t frame_id, std::uint32_t packet_id) {
  return Header(GevStatus::kPacketUnavailable, frame_id, kPayload, packet_id);
}

}  // namespace sole::sim
