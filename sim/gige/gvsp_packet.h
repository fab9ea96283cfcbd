#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/image.h"
#include "core/trigger_bus.h"
#include "sim/gige/device_memory.h"
#include "sim/gige/udp_socket.h"

namespace sole::sim {

/// IP, UDP and GVSP headers: what GevSCPSPacketSize counts beside the data.
inline constexpr std::uint32_t kIpUdpHeaderSize = 28;
inline constexpr std::uint32_t kGvspHeaderSize = 8;

/// What goes wrong with one frame.
struct FrameFaults {
  double packet_drop_probability = 0;         ///< of each packet, resent ones included
  std::chrono::nanoseconds late{0};           ///< its packets leave this much later
  std::chrono::nanoseconds begins_later{0};   ///< than its pulse: the second of a double trigger
  int skipped_ids = 0;                        ///< left out before it
  bool repeats_id = false;                    ///< has the id of the frame before
  std::optional<TriggerPulse> shows;          ///< an earlier exposure's image
};

/// Where and how one frame is sent: the registers at the time of its trigger.
struct StreamSettings {
  Endpoint destination;
  std::uint32_t packet_size = 1500;  ///< bytes with IP, UDP and GVSP headers
  std::uint32_t packet_delay_ns = 0;
  bool do_not_fragment = false;
  std::uint32_t offset_x = 0;
  std::uint32_t offset_y = 0;
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  double exposure_us = 0;
  std::uint64_t timestamp_ns = 0;             ///< the device's clock at the trigger
  std::optional<std::uint32_t> chunk_mask{};  ///< in chunk mode, see chunk_data.h
  std::uint32_t lines = 0;                    ///< LineStatusAll during the exposure
  FrameFaults faults{};
};

/// A frame that can be sent and resent packet by packet. `pixels` points into the provider's image
/// or into `cropped`.
struct SentFrame {
  std::uint16_t id = 0;  ///< 0 = empty
  StreamSettings settings;
  std::span<const std::uint8_t> pixels;
  std::vector<std::uint8_t> cropped;
  std::vector<std::uint8_t> chunks;  ///< sent behind the pixels
};

/// One packet: header (with the whole of leaders and trailers), the pixels and the chunk data that
/// follow it.
struct GvspPacket {
  std::array<std::uint8_t, 64> header{};
  std::size_t header_size = 0;
  std::span<const std::uint8_t> pixels;
  std::span<const std::uint8_t> chunks;
};

/// Takes the region of interest out of `image`. Throws Error if the image does not cover it.
void SetPixels(const ImageU8& image, SentFrame* frame);

/// Makes the chunk data, if the frame has any; needs its pixels and id.
void SetChunks(std::int64_t trigger_sequence, SentFrame* frame);

/// Leader, payload packets and trailer.
std::uint32_t PacketCount(const SentFrame& frame);

/// Packet `id` of the frame: 0 the leader, PacketCount - 1 the trailer.
GvspPacket MakePacket(const SentFrame& frame, std::uint32_t id, GevStatus status);

/// The answer to a request for a packet that is gone.
GvspPacket MakeUnavailable(std::uint16_t frame_id, std::uint32_t packet_id);

/// The id after `id`: 65535 wraps to 1, 0 is never used.
inline std::uint16_t NextFrameId(std::uint16_t id) {
  return id == 65535 ? std::uint16_t{1} : static_cast<std::uint16_t>(id + 1);
}

}  // namespace sole::sim
