#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>

#include "sim/camera_server.h"
#include "sim/gige/device_clock.h"
#include "sim/gige/device_memory.h"
#include "sim/gige/fault_schedule.h"
#include "sim/gige/gvsp_sender.h"
#include "sim/gige/udp_socket.h"

namespace sole::sim {

/// The keys of a GigE Vision action command.
struct ActionCommand {
  std::uint32_t device_key = 0;
  std::uint32_t group_key = 0;
  std::uint32_t group_mask = 0;
};

/// What a camera does with register accesses, triggers and time: control privilege and heartbeat,
/// acquisition, triggers. Used by the control thread only.
class CameraDevice {
 public:
  using Clock = std::chrono::steady_clock;

  CameraDevice(const ServedCamera& camera, const GvspSenderOptions& options,
               FrameProvider provider, const std::vector<FaultConfig>& faults);

  GevStatus Read(const Endpoint& from, std::uint32_t address, std::span<std::uint8_t> bytes);
  GevStatus Write(const Endpoint& from, std::uint32_t address, std::span<const std::uint8_t> bytes);
  /// The first registers, which answer a discovery command.
  void ReadDiscovery(std::span<std::uint8_t> bytes) const;
  void OnPulse(const TriggerPulse& pulse);
  GevStatus OnAction(const ActionCommand& action);
  /// `from` must be where the stream goes.
  void OnResend(const Endpoint& from, std::uint16_t frame_id, std::uint32_t first,
                std::uint32_t last);

  /// When OnTimer has something to do next.
  std::optional<Clock::time_point> NextDeadline() const;
  /// Frees control after a silent heartbeat timeout and exposes free-running frames.
  void OnTimer(Clock::time_point now);

  /// Whether it cannot be reached now.
  bool Unreachable() const { return silent_ || sender_.Dead(); }
  bool Controlled() const { return controller_.has_value(); }
  GvspSender& Sender() { return sender_; }
  const GvspSender& Sender() const { return sender_; }

 private:
  GevStatus WriteControl(const Endpoint& from, std::uint32_t value);
  GevStatus CheckRegion(std::uint32_t address, std::span<const std::uint8_t> bytes) const;
  void Apply(std::uint32_t address, std::span<const std::uint8_t> bytes);
  void ApplyWord(std::uint32_t address, std::uint32_t value);
  void ApplyChunkWord(std::uint32_t address, std::uint32_t value);
  void RefreshLines();
  void RefreshPayloadSize();
  void GoSilent(double seconds);
  void Reboot();
  void ReleaseControl();
  void StartAcquisition();
  void StopAcquisition();
  bool Armed(TriggerSource source) const;
  void Expose(const TriggerPulse& pulse, const FrameFaults& faults = {});
  void ExposeOwn(std::int64_t time_ns);
  StreamSettings Settings() const;
  Clock::duration FramePeriod() const;

  const ServedCamera camera_;
  DeviceMemory memory_;
  DeviceClock clock_;
  FaultSchedule schedule_;
  GvspSender sender_;
  std::optional<Endpoint> controller_;
  Clock::time_point last_heard_;
  bool acquiring_ = false;
  std::int64_t own_sequence_ = 0;
  std::int64_t frames_left_ = 0;  ///< of SingleFrame and MultiFrame
  Clock::time_point next_free_run_;
  std::uint32_t chunk_mask_ = 0;
  bool silent_ = false;
  std::optional<Clock::time_point> silent_until_;
};

/// Nanoseconds of CLOCK_REALTIME: the device clock.
std::int64_t RealtimeNs();

}  // namespace sole::sim
