#include "sim/gige/fault_schedule.h"

#include <algorithm>
#include <chrono>

namespace sole::sim {
namespace {

constexpr std::size_t kMaxPast = 32;

std::chrono::nanoseconds Milliseconds(double value) {
  return std::chrono::nanoseconds(static_cast<std::int64_t>(value * 1e6));
}

}  // namespace

FaultSchedule::FaultSchedule(const std::vector<FaultConfig>& faults, const std::string& serial) {
  for (const FaultConfig& fault : faults) {
    if (fault.camera.empty() || fault.camera == serial) faults_.push_back(fault);
  }
}

template <typename Act>
void FaultSchedule::For(const char* name, Time time, std::int64_t sequence, const Act& act) const {
  for (const FaultConfig& fault : faults_) {
    if (fault.name != name || sequence < fault.trigger) continue;
    const double after = static_cast<double>(sequence - fault.trigger);
    if (time == Time::kOnce && after > 0) continue;
    if (time == Time::kCounted && after >= fault.amount) continue;
    act(fault.amount);
  }
}

PulseFate FaultSchedule::OnPulse(const TriggerPulse& pulse) {
  past_.push_back(pulse);
  if (past_.size() > kMaxPast) past_.pop_front();
  PulseFate fate;
  FrameFaults frame;
  const std::int64_t n = pulse.sequence;
  For("lost-packets", Time::kLasting, n,
      [&](double share) { frame.packet_drop_probability = share; });
  For("late-frames", Time::kLasting, n, [&](double ms) { frame.late = Milliseconds(ms); });
  For("skipped-id", Time::kOnce, n, [&](double ids) { frame.skipped_ids = static_cast<int>(ids); });
  For("repeated-id", Time::kCounted, n, [&](double) { frame.repeats_id = true; });
  For("desync", Time::kLasting, n, [&](double frames) {
    const auto behind = std::min(static_cast<std::size_t>(frames), past_.size() - 1);
    frame.shows = past_[past_.size() - 1 - behind];
  });
  For("dead-link", Time::kOnce, n, [&](double s) { fate.dead_link_s = s; });
  For("reboot", Time::kOnce, n, [&](double s) { fate.reboot_s = s; });
  For("clock-drift", Time::kLasting, n, [&](double ppm) { fate.extra_drift_ppm = ppm; });
  bool missed = false;
  For("missing-trigger", Time::kCounted, n, [&](double) { missed = true; });
  if (missed) return fate;
  fate.exposures.push_back(frame);
  For("double-trigger", Time::kOnce, n, [&](double ms) {
    FrameFaults second = frame;
    second.begins_later = Milliseconds(ms);
    fate.exposures.push_back(second);
  });
  return fate;
}

}  // namespace sole::sim
