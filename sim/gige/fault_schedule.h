#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "core/fault.h"
#include "core/trigger_bus.h"
#include "sim/gige/gvsp_packet.h"

namespace sole::sim {

/// What becomes of one trigger pulse at one camera.
struct PulseFate {
  std::vector<FrameFaults> exposures;     ///< one if nothing goes wrong
  std::optional<double> dead_link_s;      ///< the link dies now; 0 = for good
  std::optional<double> reboot_s;         ///< the camera restarts now
  std::optional<double> extra_drift_ppm;  ///< of its clock from now on
};

/// The faults of one camera that show on the wire, by trigger number.
class FaultSchedule {
 public:
  /// Keeps those of `faults` that concern the camera with this serial.
  FaultSchedule(const std::vector<FaultConfig>& faults, const std::string& serial);

  /// Pulses must come in order. Warm-ups suffer nothing.
  PulseFate OnPulse(const TriggerPulse& pulse);

 private:
  /// Calls act(amount) for every fault `name` whose time has come: at its trigger and `amount` - 1
  /// after it (kCounted), at its trigger (kOnce), or from it on (kLasting).
  enum class Time { kOnce, kCounted, kLasting };
  template <typename Act>
  void For(const char* name, Time time, std::int64_t sequence, const Act& act) const;

  std::vector<FaultConfig> faults_;
  std::deque<TriggerPulse> past_;  ///< newest last, this one included
};

}  // namespace sole::sim
