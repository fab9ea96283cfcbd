#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>

namespace sole {

/// One pulse on the simulated trigger line: a UDP datagram to 127.0.0.1:TriggerConfig::bus_port. Stands for the electrical
/// edge that all cameras see at once. Little endian: magic, sequence, scheduled_ns, kind, 4 zero bytes.
struct TriggerPulse {
  std::int64_t sequence = 0;      ///< counts from 1; 0 or less = warm-up
  std::int64_t scheduled_ns = 0;  ///< CLOCK_REALTIME
  std::uint32_t kind = 0;         ///< ExposureKind: 0 speckle, 1 texture
};

inline constexpr std::size_t kTriggerPulseSize = 32;
inline constexpr char kTriggerPulseMagic[9] = "SOLETRG1";

inline std::array<std::uint8_t, kTriggerPulseSize> Encode(const TriggerPulse& pulse) {
  std::array<std::uint8_t, kTriggerPulseSize> bytes{};
  std::memcpy(bytes.data(), kTriggerPulseMagic, 8);
  std::memcpy(bytes.data() + 8, &pulse.sequence, 8);
  std::memcpy(bytes.data() + 16, &pulse.scheduled_ns, 8);
  std::memcpy(bytes.data() + 24, &pulse.kind, 4);
  return bytes;
}

/// Empty if the datagram is not a pulse.
inline std::optional<TriggerPulse> DecodeTriggerPulse(std::span<const std::uint8_t> bytes) {
  if (bytes.size() != kTriggerPulseSize || std::memcmp(bytes.data(), kTriggerPulseMagic, 8) != 0) return {};
  TriggerPulse pulse;
  std::memcpy(&pulse.sequence, bytes.data() + 8, 8);
  std::memcpy(&pulse.scheduled_ns, bytes.data() + 16, 8);
  std::memcpy(&pulse.kind, bytes.data() + 24, 4);
  if (pulse.kind > 1) return {};
  return pulse;
}

}  // namespace sole
