#pragma once

#include <cstdint>

namespace sole::sim {

enum PtpStatus : std::uint32_t { kPtpDisabled = 3, kPtpUncalibrated = 8, kPtpSlave = 9 };

/// The clock of one device, ns. Off by an offset and a drift against the time of the rig
/// (CLOCK_REALTIME); with PTP enabled it closes in on that time exponentially and stays there.
class DeviceClock {
 public:
  DeviceClock(std::int64_t now_ns, std::int64_t offset_ns, double drift_ppm)
      : since_ns_(now_ns), error_ns_(static_cast<double>(offset_ns)), drift_ppm_(drift_ppm) {}

  /// What the clock shows at `time_ns`.
  std::int64_t At(std::int64_t time_ns) const {
    return time_ns + static_cast<std::int64_t>(ErrorNs(time_ns));
  }
  double ErrorNs(std::int64_t time_ns) const;
  void SetDrift(std::int64_t now_ns, double drift_ppm);
  void SetPtp(std::int64_t now_ns, bool enabled);
  PtpStatus Status(std::int64_t now_ns) const;

 private:
  std::int64_t since_ns_;
  double error_ns_;  ///< at since_ns_
  double drift_ppm_;
  bool ptp_ = false;
};

}  // namespace sole::sim
