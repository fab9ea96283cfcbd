#include <algorithm>
#include <map>
#include <optional>

#include "io/take_timing_internal.h"

namespace sole::io {
namespace {

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double DeviceSeconds(const RawRecord& record, std::uint64_t base_ns) {
  return 1e-9 *
         static_cast<double>(static_cast<std::int64_t>(record.header.device_time_ns - base_ns));
}

/// One camera's times on the clock of triggers.csv, by trigger; empty without a trigger that both
/// know.
std::map<std::int64_t, double> TimesOf(const std::vector<RawRecord>& records,
                                       const std::map<std::int64_t, TriggerRecord>& known) {
  std::map<std::int64_t, double> times;
  if (records.empty()) return times;
  const std::uint64_t base_ns = records.front().header.device_time_ns;
  std::vector<double> offsets;
  for (const RawRecord& record : records) {
    const auto trigger = known.find(record.header.trigger);
    if (record.header.status == 0 && trigger != known.end())
      offsets.push_back(trigger->second.actual_s - DeviceSeconds(record, base_ns));
  }
  if (offsets.empty()) return times;
  const double offset = Median(offsets);
  for (const RawRecord& record : records) {
    // An incomplete frame's time may be that of another one.
    if (record.header.status == 0)
      times.emplace(record.header.trigger, DeviceSeconds(record, base_ns) + offset);
  }
  return times;
}

/// The planned trigger, from the one a cycle earlier if that is known.
TriggerRecord Planned(std::int64_t number, const RigConfig& config,
                      const std::map<std::int64_t, TriggerRecord>& known) {
  const auto cycle = static_cast<std::int64_t>(config.trigger.exposures.size());
  const double period_s = 1 / config.trigger.rate_hz;
  TriggerRecord planned{.trigger = number};
  const std::int64_t place = (number - 1) % cycle;
  const double gap_s = config.trigger.exposure_gap_s > 0 ? config.trigger.exposure_gap_s
                                                         : period_s / static_cast<double>(cycle);
  planned.kind = config.trigger.exposures[static_cast<std::size_t>(place)];
  planned.scheduled_s =
      static_cast<double>((number - 1) / cycle) * period_s + static_cast<double>(place) * gap_s;
  if (const auto earlier = known.find(number - cycle); earlier != known.end()) {
    planned.kind = earlier->second.kind;
    planned.scheduled_s = earlier->second.scheduled_s + period_s;
  }
  return planned;
}

}  // namespace

void CompleteTriggers(std::vector<TriggerRecord>& triggers, std::int64_t last,
                      const RigConfig& config, const std::vector<std::vector<RawRecord>>& cameras) {
  std::map<std::int64_t, TriggerRecord> known;
  for (const TriggerRecord& trigger : triggers) known.emplace(trigger.trigger, trigger);
  std::map<std::int64_t, ExposureKind> kinds;
  std::map<std::int64_t, std::vector<double>> times;
  for (const std::vector<RawRecord>& records : cameras) {
    for (const RawRecord& record : records) {
      if (record.header.kind) kinds.emplace(record.header.trigger, *record.header.kind);
    }
    for (const auto& [trigger, time] : TimesOf(records, known)) times[trigger].push_back(time);
  }
  double exposure_s = 0;
  for (const CameraConfig& camera : config.cameras)
    exposure_s = std::max(exposure_s, 1e-6 * camera.exposure_us);
  for (std::int64_t number = 1; number <= last; ++number) {
    if (known.contains(number)) continue;
    TriggerRecord added = Planned(number, config, known);
    if (const auto kind = kinds.find(number); kind != kinds.end()) added.kind = kind->second;
    const auto time = times.find(number);
    added.actual_s = time != times.end() ? Median(time->second) : added.scheduled_s;
    added.exposure_start_s = added.actual_s;
    added.exposure_end_s = added.actual_s + exposure_s;
    known.emplace(number, added);
  }
  triggers.clear();
  for (const auto& [number, trigger] : known) triggers.push_back(trigger);
}

}  // namespace sole::io
