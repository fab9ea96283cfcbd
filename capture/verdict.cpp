#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iterator>
#include <utility>

#include "capture/take_folder_internal.h"

namespace sole::capture {
namespace {

/// "4, 7 to 9 and 2 more"
std::string Ranges(const std::vector<std::int64_t>& triggers) {
  constexpr int kShown = 5;
  std::string text;
  int shown = 0;
  std::size_t i = 0;
  while (i < triggers.size() && shown < kShown) {
    std::size_t end = i;
    while (end + 1 < triggers.size() && triggers[end + 1] == triggers[end] + 1) ++end;
    text += (shown++ == 0 ? "" : ", ") + std::to_string(triggers[i]);
    if (end > i) text += (end == i + 1 ? ", " : " to ") + std::to_string(triggers[end]);
    i = end + 1;
  }
  if (i < triggers.size()) text += " and " + std::to_string(triggers.size() - i) + " more";
  return text;
}

std::string Of(std::int64_t count, const CameraRecord& camera) {
  return std::to_string(count) + " of " + std::to_string(camera.expected) + " frames";
}

constexpr double kResentShare = 0.005;  // below it, what is repaired is nobody's worry
constexpr double kLateS = 0.030;        // of one camera against the others
constexpr double kClockPpm = 60;        // crystals stay within 50

std::string Text(const char* format, double value) {
  char text[48];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// What is lost and told for the rig as a whole (`by_all`) is not told again for every camera.
void AddLosses(const CameraRecord& camera, const std::vector<std::int64_t>& by_all,
               std::vector<std::string>& reasons) {
  const std::string name = "camera " + camera.serial + ": ";
  if (camera.lost > 0 && camera.lost_triggers != by_all) {
    std::string reason =
        name + Of(camera.lost, camera) + " lost (triggers " + Ranges(camera.lost_triggers) + ")";
    if (camera.dropped > 0)
      reason += ", " + std::to_string(camera.dropped) + " of them because the disk is too slow";
    reasons.push_back(reason);
  }
  if (camera.incomplete > 0)
    reasons.push_back(name + Of(camera.incomplete, camera) + " incomplete (packets missing)");
  for (const CameraGap& gap : camera.gaps) {
    reasons.push_back(name + "silent for " + Text("%.1f", gap.seconds) + " s after trigger " +
                      std::to_string(gap.after_trigger) +
                      (!gap.ended      ? " until the end: check its cable and power"
                       : gap.reopened ? ", then connected again with all settings"
                                      : ", then back by itself: check its cable"));
  }
}

void AddIds(const CameraRecord& camera, const std::vector<std::int64_t>& by_all,
            std::vector<std::string>& reasons) {
  const std::string name = "camera " + camera.serial + ": ";
  const auto times = [](std::int64_t n) { return std::to_string(n) + (n == 1 ? " time" : " times"); };
  const std::int64_t doubled = std::min(camera.ids_ahead, camera.strays);
  if (camera.ids_behind > static_cast<std::int64_t>(by_all.size())) {
    reasons.push_back(name + "missed a trigger pulse or repeated a frame id " +
                      times(camera.ids_behind - static_cast<std::int64_t>(by_all.size())) + ": check its trigger cable");
  }
  if (doubled > 0) {
    reasons.push_back(name + "exposed twice for one trigger " + times(doubled) +
                      " (double pulse): check the trigger line");
  }
  if (camera.ids_ahead > doubled) {
    reasons.push_back(name + "skipped a frame id " + times(camera.ids_ahead - doubled) +
                      " without losing the frame; frames were placed by their timestamps");
  }
  if (camera.strays > doubled) {
    reasons.push_back(name + std::to_string(camera.strays - doubled) +
                      " frames belong to no trigger and were left out");
  }
}

void AddTimes(const RecordResult& result, const CameraRecord& camera,
              std::vector<TakeFinding>& findings) {
  const std::string name = "camera " + camera.serial + ": ";
  if (camera.resent_share >= kResentShare) {
    findings.push_back({name + Text("%.1f", 100 * camera.resent_share) +
                            " % of its packets had to be sent again: check cable and switch, "
                            "raise packet_delay_ns",
                        false});
  }
  std::vector<double> others;
  for (const CameraRecord& other : result.cameras) {
    if (other.serial != camera.serial) others.push_back(other.latency_median_s);
  }
  const double usual = others.empty() ? camera.latency_warmup_s : Median(others);
  if (camera.latency_median_s > usual + kLateS &&
      camera.latency_median_s > camera.latency_warmup_s + kLateS) {
    findings.push_back({name + "frames arrive late (" +
                            Text("%.0f ms", 1e3 * camera.latency_median_s) + " after the trigger, " +
                            Text("%.0f ms", 1e3 * usual) + " is usual): check its network link",
                        false});
  }
  if (camera.clock && std::abs(camera.clock->ppm) > kClockPpm &&
      std::abs(camera.clock->ppm) > 5 * camera.clock->sd_ppm) {
    findings.push_back({name + "its clock runs " +
                            Text("%.0f ppm ", std::abs(camera.clock->ppm)) +
                            (camera.clock->ppm > 0 ? "fast" : "slow") +
                            ": enable PTP (GevIEEE1588) on camera and switch",
                        false});
  }
  if (camera.shift != 0) {
    findings.push_back({name + "its images " + (camera.shift > 0 ? "lag behind" : "run ahead of") +
                            " those of the other cameras by " +
                            std::to_string(std::abs(camera.shift)) +
                            " triggers (out of sync): check its trigger settings and delays",
                        true});
  }
}

/// Triggers that no camera has.
std::vector<std::int64_t> LostByAll(const RecordResult& result) {
  if (result.cameras.size() < 2) return {};
  std::vector<std::int64_t> all = result.cameras[0].lost_triggers;
  for (const CameraRecord& camera : result.cameras) {
    std::vector<std::int64_t> both;
    std::set_intersection(all.begin(), all.end(), camera.lost_triggers.begin(),
                          camera.lost_triggers.end(), std::back_inserter(both));
    all = std::move(both);
  }
  return all;
}

}  // namespace

std::vector<TakeFinding> DeliveryFindings(const RecordResult& result, double usable_loss,
                                          double period_s) {
  std::vector<TakeFinding> findings;
  const std::vector<std::int64_t> by_all = LostByAll(result);
  if (!by_all.empty()) {
    findings.push_back({"no camera has a frame of triggers " + Ranges(by_all) +
                            ": the trigger line missed pulses, check its cable",
                        static_cast<double>(by_all.size()) >
                            usable_loss * static_cast<double>(result.triggers)});
  }
  if (!result.unexposed.empty()) {
    findings.push_back({"triggers " + Ranges(result.unexposed) +
                            " were not confirmed by the exposure read-back: check its line and "
                            "the cameras' outputs",
                        false});
  }
  std::vector<double> late;
  for (const CameraRecord& camera : result.cameras) {
    std::vector<std::string> reasons;
    AddLosses(camera, by_all, reasons);
    AddIds(camera, by_all, reasons);
    const bool repeat =
        camera.expected > 0 && static_cast<double>(camera.expected - camera.good) >
                                   usable_loss * static_cast<double>(camera.expected);
    for (const std::string& reason : reasons) findings.push_back({reason, repeat});
    AddTimes(result, camera, findings);
    late.push_back(camera.latency_median_s - camera.latency_warmup_s);
  }
  if (Median(late) > period_s) {
    findings.push_back({"frames arrive late at every camera (" +
                            Text("%.0f ms", 1e3 * Median(late)) +
                            " later than at warm-up): this computer or its network is overloaded",
                        false});
  }
  return findings;
}

void Judge(RecordResult& result, std::int64_t planned, double usable_loss, double period_s,
           const std::vector<TakeFinding>& findings) {
  bool repeat = result.state == "aborted" || result.triggers == 0;
  const auto add = [&](const std::vector<TakeFinding>& list) {
    for (const TakeFinding& finding : list) {
      result.reasons.push_back(finding.reason);
      repeat = repeat || finding.repeat;
    }
  };
  if (result.triggers == 0) result.reasons.push_back("no trigger was fired");
  add(DeliveryFindings(result, usable_loss, period_s));
  add(findings);
  if (result.stopped) {
    result.reasons.push_back("stopped after " + std::to_string(result.triggers) + " of " +
                             std::to_string(planned) + " triggers");
  }
  result.verdict = repeat ? "repeat" : result.reasons.empty() ? "good" : "usable";
}

std::int64_t RecordResult::FramesExpected() const {
  std::int64_t sum = 0;
  for (const CameraRecord& camera : cameras) sum += camera.expected;
  return sum;
}

std::int64_t RecordResult::FramesGood() const {
  std::int64_t sum = 0;
  for (const CameraRecord& camera : cameras) sum += camera.good;
  return sum;
}

std::int64_t RecordResult::FramesLost() const { return FramesExpected() - FramesGood(); }

}  // namespace sole::capture
