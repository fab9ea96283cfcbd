#include "sim/gige/camera_device.h"

#include <algorithm>
#include <utility>

#include "sim/gige/big_endian.h"
#include "sim/gige/chunk_data.h"

namespace sole::sim {
namespace {

constexpr std::uint32_t kExposureActiveBit = 2;  // Line2 of LineStatusAll
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
                           FrameProvider provider, const std::vector<FaultConfig>& faults)
    : camera_(camera),
      memory_(camera),
      clock_(RealtimeNs(), camera.clock_offset_ns, camera.clock_drift_ppm),
      schedule_(faults, camera.serial),
      sender_(options, std::move(provider)) {
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
  if (address == reg::kPtpStatus) memory_.Set32(address, clock_.Status(RealtimeNs()));
  return memory_.Read(address, bytes);
}

GevStatus CameraDevice::Write(const Endpoint& from, std::uint32_t address,
                              std::span<const std::uint8_t> bytes) {
  if (address == reg::kControl && bytes.size() == 4) return WriteControl(from, Load32(bytes, 0));
  if (controller_ != from) return GevStatus::kAccessDenied;
  last_heard_ = Clock::now();
  GevStatus status = memory_.CheckWrite(address, bytes, acquiring_);
  if (status == GevStatus::kSuccess) status = CheckRegion(address, bytes);
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

/// The region must stay on the sensor once all of `bytes` are written.
GevStatus CameraDevice::CheckRegion(std::uint32_t address,
                                    std::span<const std::uint8_t> bytes) const {
  const auto then = [&](std::uint32_t at) {
    const bool written = at >= address && at - address + 4 <= bytes.size();
    return written ? Load32(bytes, at - address) : memory_.Get32(at);
  };
  const auto fits = [&](std::uint32_t offset, std::uint32_t size, std::uint32_t sensor) {
    return then(offset) + then(size) <= memory_.Get32(sensor);
  };
  const bool inside = fits(reg::kOffsetX, reg::kWidth, reg::kSensorWidth) &&
                      fits(reg::kOffsetY, reg::kHeight, reg::kSensorHeight);
  return inside ? GevStatus::kSuccess : GevStatus::kInvalidParameter;
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
      RefreshPayloadSize();
      break;
    case reg::kChunkMode:
    case reg::kChunkSelector:
    case reg::kChunkEnable:
      ApplyChunkWord(address, value);
      break;
    case reg::kPtpEnable:
      clock_.SetPtp(RealtimeNs(), value == 1);
      break;
    case reg::kPtpLatch:
      memory_.Set64(reg::kPtpOffset, static_cast<std::uint64_t>(
                                         static_cast<std::int64_t>(clock_.ErrorNs(RealtimeNs()))));
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
        memory_.Set64(reg::kTimestampLatched,
                      static_cast<std::uint64_t>(clock_.At(RealtimeNs())));
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

/// ChunkEnable shows and sets the bit that ChunkSelector chooses.
void CameraDevice::ApplyChunkWord(std::uint32_t address, std::uint32_t value) {
  const std::uint32_t kind = memory_.Get32(reg::kChunkSelector);
  if (address == reg::kChunkEnable)
    chunk_mask_ = (chunk_mask_ & ~(1U << kind)) | ((value & 1) << kind);
  memory_.Set32(reg::kChunkEnable, chunk_mask_ >> kind & 1);
  RefreshPayloadSize();
}

void CameraDevice::RefreshPayloadSize() {
  const std::uint32_t image = memory_.Get32(reg::kWidth) * memory_.Get32(reg::kHeight);
  const bool chunks = memory_.Get32(reg::kChunkMode) == 1;
  memory_.Set32(reg::kPayloadSize, image + (chunks ? ChunkDataSize(chunk_mask_) : 0));
}

/// The link is gone; what the camera does goes on. 0 seconds: for good.
void CameraDevice::GoSilent(double seconds) {
  silent_ = true;
  sender_.SetSilent(true);
  silent_until_.reset();
  if (seconds > 0) {
    silent_until_ = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                       std::chrono::duration<double>(seconds));
  }
}

/// Back to power-up values: nothing that was written is left.
void CameraDevice::Reboot() {
  ReleaseControl();
  sender_.RestartFrameIds();
  memory_ = DeviceMemory(camera_);
  memory_.Set32(reg::kStreamSourcePort, sender_.SourcePort());
  chunk_mask_ = 0;
  clock_ = {RealtimeNs(), camera_.clock_offset_ns, camera_.clock_drift_ppm};
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
  const PulseFate fate = schedule_.OnPulse(pulse);
  if (fate.extra_drift_ppm)
    clock_.SetDrift(RealtimeNs(), camera_.clock_drift_ppm + *fate.extra_drift_ppm);
  if (fate.dead_link_s) GoSilent(*fate.dead_link_s);
  if (fate.reboot_s) {
    Reboot();
    GoSilent(*fate.reboot_s);
  }
  for (const FrameFaults& faults : fate.exposures) {
    if (Armed(kSourceLine1)) Expose(pulse, faults);
  }
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

void CameraDevice::Expose(const TriggerPulse& pulse, const FrameFaults& faults) {
  if (sender_.Dead()) return;
  StreamSettings settings = Settings();
  settings.timestamp_ns =
      static_cast<std::uint64_t>(clock_.At(pulse.scheduled_ns + faults.begins_later.count()));
  settings.faults = faults;
  sender_.Expose(pulse, settings);
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
          .exposure_us = memory_.GetFloat(reg::kExposureTime),
          .chunk_mask = memory_.Get32(reg::kChunkMode) == 1 ? std::optional(chunk_mask_)
                                                            : std::nullopt,
          .lines = kExposureActiveBit};
}

CameraDevice::Clock::duration CameraDevice::FramePeriod() const {
  return std::chrono::nanoseconds(
      static_cast<std::int64_t>(1e9 / memory_.GetFloat(reg::kFrameRate)));
}

std::optional<CameraDevice::Clock::time_point> CameraDevice::NextDeadline() const {
  if (!controller_) return silent_until_;
  Clock::time_point deadline =
      last_heard_ + std::chrono::milliseconds(memory_.Get32(reg::kHeartbeatTimeout));
  if (acquiring_ && memory_.Get32(reg::kTriggerMode) == 0)
    deadline = std::min(deadline, next_free_run_);
  if (silent_until_) deadline = std::min(deadline, *silent_until_);
  return deadline;
}

void CameraDevice::OnTimer(Clock::time_point now) {
  if (silent_until_ && now >= *silent_until_) {
    silent_until_.reset();
    silent_ = false;
    sender_.SetSilent(false);
  }
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
