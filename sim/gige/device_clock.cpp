#include "sim/gige/device_clock.h"

#include <algorithm>
#include <cmath>

namespace sole::sim {
namespace {

constexpr double kSettleNs = 0.1e9;     // time constant of the control loop
constexpr double kCalibratedNs = 1000;  // a slave's offset

}  // namespace

double DeviceClock::ErrorNs(std::int64_t time_ns) const {
  // Times before the last change have its error.
  const double passed = static_cast<double>(std::max<std::int64_t>(time_ns - since_ns_, 0));
  if (ptp_) return error_ns_ * std::exp(-passed / kSettleNs);
  return error_ns_ + 1e-6 * drift_ppm_ * passed;
}

void DeviceClock::SetDrift(std::int64_t now_ns, double drift_ppm) {
  error_ns_ = ErrorNs(now_ns);
  since_ns_ = now_ns;
  drift_ppm_ = drift_ppm;
}

void DeviceClock::SetPtp(std::int64_t now_ns, bool enabled) {
  if (enabled == ptp_) return;
  error_ns_ = ErrorNs(now_ns);
  since_ns_ = now_ns;
  ptp_ = enabled;
}

PtpStatus DeviceClock::Status(std::int64_t now_ns) const {
  if (!ptp_) return kPtpDisabled;
  return std::abs(ErrorNs(now_ns)) > kCalibratedNs ? kPtpUncalibrated : kPtpSlave;
}

}  // namespace sole::sim
