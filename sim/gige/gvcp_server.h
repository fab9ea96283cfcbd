#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sim/gige/camera_device.h"

namespace sole::sim {

/// UDP port of GigE Vision control on every device.
inline constexpr std::uint16_t kGvcpPort = 3956;

/// Carries out one control packet that reached `device` from `from` and returns the
/// acknowledgement; empty if none is due. `broadcast`: the packet went to every device, which
/// matters to discovery and action commands only.
std::vector<std::uint8_t> AnswerGvcp(std::span<const std::uint8_t> packet, const Endpoint& from,
                                     bool broadcast, CameraDevice* device);

}  // namespace sole::sim
