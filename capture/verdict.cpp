#include <algorithm>

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

void AddReasons(const CameraRecord& camera, std::vector<std::string>& reasons) {
  const std::string name = "camera " + camera.serial + ": ";
  if (camera.lost > 0) {
    std::string reason =
        name + Of(camera.lost, camera) + " lost (triggers " + Ranges(camera.lost_triggers) + ")";
    if (camera.dropped > 0)
      reason += ", " + std::to_string(camera.dropped) + " of them because the disk is too slow";
    reasons.push_back(reason);
  }
  if (camera.incomplete > 0)
    reasons.push_back(name + Of(camera.incomplete, camera) + " incomplete (packets missing)");
  if (camera.realigned > 0) {
    reasons.push_back(name + "frame ids left the count " + std::to_string(camera.realigned) +
                      " times; frames were placed by their timestamps");
  }
  if (camera.strays > 0) {
    reasons.push_back(name + std::to_string(camera.strays) +
                      " frames belong to no trigger and were left out");
  }
}

}  // namespace

void Judge(RecordResult& result, std::int64_t planned, double usable_loss) {
  double worst = 0;
  for (const CameraRecord& camera : result.cameras) {
    AddReasons(camera, result.reasons);
    if (camera.expected > 0) {
      worst = std::max(worst, static_cast<double>(camera.expected - camera.good) /
                                  static_cast<double>(camera.expected));
    }
  }
  if (result.stopped) {
    result.reasons.push_back("stopped after " + std::to_string(result.triggers) + " of " +
                             std::to_string(planned) + " triggers");
  }
  const bool repeat = result.state == "aborted" || result.triggers == 0 || worst > usable_loss;
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
