#include "sim/gige/camera_device.h"

#include <algorithm>
#include <utility>

#include "sim/gige/big_endian.h"

namespace sole::sim {
namespace {

constexpr std::uint32_t kExclusiveBit = 1;
constexpr std::uint32_t kFireTestBit = 1U << 31;
constexpr std::uint32_t kDoNotFragmentBit = 1U << 30;

}  // namespace

std::int64_t RealtimeNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

CameraDevice::CameraDevice(const ServedCamera& camera, const GvspSenderOptions& options,
                           FrameProvider provider)
    : memory_(camera), sender_(options, std::move(provider)) {
  memory_.Set32(reg::kStreamSourcePort, sender_.SourcePort());
}

GevStatus CameraDevice::Read(const Endpoint& from, std::uint32_t address,
                             std::span<std::uint8_t> bytes) {
  if (controller_ == from) {
    last_heard_ = Clock::now();
  } else if (controller_ && (memory_.Get32(reg::kControl) & kExclusiveBit) != 0) {
    return GevStatus::kAccessDenied;
  }
  if (address % 4 != 0 || bytes.size() % 4 != 0) return GevStatus::kBadAlignment;
  if (address >= reg::kLineMode && address <= reg::kLineStatus) RefreshLines();
  return memory_.Read(address, bytes);
}

GevStatus CameraDevice::Write(const Endpoint& from, std::uint32_t address,
                              std::span<const std::uint8_t> bytes) {
  if (address == reg::kControl && bytes.size() == 4) return WriteControl(from, Load32(bytes, 0));
  if (controller_ != from) return GevStatus::kAccessDenied;
  last_heard_ = Clock::now();
  GevStatus status = memory_.CheckWrite(address, bytes, acquiring_);
  for (std::uint32_t at = 0; status == GevStatus::kSuccess && at + 4 <= bytes.size(); at += 4) {
    status = CheckRegion(address + at, Load32(bytes, at));
  }
  if (status == GevStatus::kSuccess) Apply(address, bytes);
  return status;
}

GevStatus CameraDevice::WriteControl(const Endpoint& from, std::uint32_t value) {
  if (controller_ && controller_ != from) return GevStatus::kAccessDenied;
  if (value > 3) return GevStatus::kInvalidParameter;
  if (value == 0) {
    if (controller_) ReleaseControl();
    return GevStatus::kSuccess;
  }
  controller_ = from;
  last_heard_ = Clock::now();
  memory_.Set32(reg::kControl, value);
  return GevStatus::kSuccess;
}

/// The region must stay on the sensor.
GevStatus CameraDevice::CheckRegion(std::uint32_t address, std::uint32_t value) const {
  const auto now = [&](std::uint32_t at) { return at == address ? value : memory_.Get32(at); };
  const bool horizontal = address == reg::kWidth || address == reg::kOffsetX;
  const bool vertical = address == reg::kHeight || address == reg::kOffsetY;
  if (horizontal && now(reg::kWidth) + now(reg::kOffsetX) > memory_.Get32(reg::kSensorWidth)) {
    return GevStatus::kInvalidParameter;
  }
  if (vertical && now(reg::kHeight) + now(reg::kOffsetY) > memory_.Get32(reg::kSensorHeight)) {
    return GevStatus::kInvalidParameter;
  }
  return GevStatus::kSuccess;
}

void CameraDevice::Apply(std::uint32_t address, std::span<const std::uint8_t> bytes) {
  memory_.SetBytes(address, bytes);
  for (std::uint32_t at = 0; at + 4 <= bytes.size(); at += 4)
    ApplyWord(address + at, Load32(bytes, at));
}

void CameraDevice::ApplyWord(std::uint32_t address, std::uint32_t value) {
  switch (address) {
    case reg::kWidth:
    case reg::kHeight:
      memory_.Set32(reg::kPayloadSize, memory_.Get32(reg::kWidth) * memory_.Get32(reg::kHeight));
      break;
    case reg::kAcquisitionStart:
      StartAcquisition();
      break;
    case reg::kAcquisitionStop:
      StopAcquisition();
      break;
    case reg::kTriggerMode:
      next_free_run_ = Clock::now();
      break;
    case reg::kTriggerSoftware:
      if (Armed(kSourceSoftware)) ExposeOwn(RealtimeNs());
      break;
    case reg::kTimestampControl:
      if ((value & 2) != 0)
        memory_.Set64(reg::kTimestampLatched, static_cast<std::uint64_t>(RealtimeNs()));
      break;
    case reg::kStreamPort:
      if ((value & 0xFFFF) != 0) {
        sender_.RestartFrameIds();
      } else {
        sender_.Clear();
      }
      break;
    case reg::kPacketSize:
      memory_.Set32(reg::kPacketSize, value & ~kFireTestBit);
      if ((value & kFireTestBit) != 0 && (memory_.Get32(reg::kStreamPort) & 0xFFFF) != 0) {
        sender_.SendTestPacket(Settings());
      }
      break;
    default:
      break;
  }
}

void CameraDevice::ReadDiscovery(std::span<std::uint8_t> bytes) const { memory_.Read(0, bytes); }

/// Line1 is the trigger input; its pulses are too short to be seen. Line2 puts out exposure-active.
void CameraDevice::RefreshLines() {
  const bool output = memory_.Get32(reg::kLineSelector) == kLine2;
  memory_.Set32(reg::kLineMode, output ? 1 : 0);
  memory_.Set32(reg::kLineStatus, output && sender_.Exposing() ? 1 : 0);
}

void CameraDevice::ReleaseControl() {
  StopAcquisition();
  controller_.reset();
  memory_.Set32(reg::kControl, 0);
  memory_.Set32(reg::kStreamPort, 0);
}

void CameraDevice::StartAcquisition() {
  acquiring_ = true;
  own_sequence_ = 0;
  next_free_run_ = Clock::now();
  const std::uint32_t mode = memory_.Get32(reg::kAcquisitionMode);
  frames_left_ = mode == kSingleFrame ? 1 : memory_.Get32(reg::kFrameCount);
}

void CameraDevice::StopAcquisition() {
  acquiring_ = false;
  sender_.Clear();
}

bool CameraDevice::Armed(TriggerSource source) const {
  return acquiring_ && memory_.Get32(reg::kTriggerMode) == 1 &&
         memory_.Get32(reg::kTriggerSource) == source;
}

void CameraDevice::OnPulse(const TriggerPulse& pulse) {
  if (Armed(kSourceLine1)) Expose(pulse);
}

GevStatus CameraDevice::OnAction(const ActionCommand& action) {
  const bool ours = controller_ && action.device_key == memory_.Get32(reg::kActionKey) &&
                    action.group_key == memory_.Get32(reg::kActionGroupKey) &&
                    (action.group_mask & memory_.Get32(reg::kActionGroupMask)) != 0;
  if (!ours) return GevStatus::kInvalidParameter;
  if (Armed(kSourceAction1)) ExposeOwn(RealtimeNs());
  return GevStatus::kSuccess;
}

void CameraDevice::OnResend(const Endpoint& from, std::uint16_t frame_id, std::uint32_t first,
                            std::uint32_t last) {
  const bool ours =
      controller_ && (from.address == memory_.Get32(reg::kStreamAddress) || from == *controller_);
  if (ours) sender_.Resend(frame_id, first, last);
}

void CameraDevice::ExposeOwn(std::int64_t time_ns) {
  Expose({.sequence = ++own_sequence_, .scheduled_ns = time_ns, .kind = 0});
}

void CameraDevice::Expose(const TriggerPulse& pulse) {
  if (sender_.Dead()) return;
  sender_.Expose(pulse, Settings());
  if (memory_.Get32(reg::kAcquisitionMode) != kContinuous && --frames_left_ <= 0)
    acquiring_ = false;
}

StreamSettings CameraDevice::Settings() const {
  const std::uint32_t packet = memory_.Get32(reg::kPacketSize);
  return {.destination = {memory_.Get32(reg::kStreamAddress),
                          static_cast<std::uint16_t>(memory_.Get32(reg::kStreamPort) & 0xFFFF)},
          .packet_size = packet & 0xFFFF,
          .packet_delay_ns = memory_.Get32(reg::kPacketDelay),
          .do_not_fragment = (packet & kDoNotFragmentBit) != 0,
          .offset_x = memory_.Get32(reg::kOffsetX),
          .offset_y = memory_.Get32(reg::kOffsetY),
          .width = memory_.Get32(reg::kWidth),
          .height = memory_.Get32(reg::kHeight),
          .exposure_us = memory_.GetFloat(reg::kExposureTime)};
}

CameraDevice::Clock::duration CameraDevice::FramePeriod() const {
  return std::chrono::nanoseconds(
      static_cast<std::int64_t>(1e9 / memory_.GetFloat(reg::kFrameRate)));
}

std::optional<CameraDevice::Clock::time_point> CameraDevice::NextDeadline() const {
  if (!controller_) return {};
  Clock::time_point deadline =
      last_heard_ + std::chrono::milliseconds(memory_.Get32(reg::kHeartbeatTimeout));
  if (acquiring_ && memory_.Get32(reg::kTriggerMode) == 0)
    deadline = std::min(deadline, next_free_run_);
  return deadline;
}

void CameraDevice::OnTimer(Clock::time_point now) {
  if (!controller_) return;
  if (now >= last_heard_ + std::chrono::milliseconds(memory_.Get32(reg::kHeartbeatTimeout))) {
    ReleaseControl();
    return;
  }
  if (acquiring_ && memory_.Get32(reg::kTriggerMode) == 0 && now >= next_free_run_) {
    // The timestamp is the ideal instant, however late this thread woke up.
    const std::int64_t late_ns =
        std::chrono::duration_cast<std::chrono::nanoseconds>(now - next_free_run_).count();
    next_free_run_ += FramePeriod();
    if (next_free_run_ <= now) next_free_run_ = now + FramePeriod();
    // A camera runs no faster than its link.
    if (sender_.Idle()) ExposeOwn(RealtimeNs() - late_ns);
  }
}

}  // namespace sole::sim
