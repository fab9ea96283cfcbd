#include "app/dataset_info.h"

#include <cmath>
#include <map>
#include <vector>

#include <fmt/format.h>

#include "app/registrations.h"
#include "contact/label.h"

namespace sole::app {
namespace {

using Eigen::Index;
using nlohmann::json;

constexpr float kSeenSd_m = 0.0002F;  // scan points hold a vertex that is known better than this

/// Means over vertices of good frames, and of labels against the truth.
struct Tally {
  long vertices = 0, seen = 0, touching = 0;
  double drift_m = 0;
  long with_truth = 0, both = 0, said = 0, true_contact = 0;
};

void AddFrame(const SubjectRegistrations& r, std::size_t f, Tally& tally) {
  const auto row = static_cast<Index>(f);
  for (Index v = 0; v < r.NumVertices(); ++v) {
    ++tally.vertices;
    tally.seen += r.sd_m(row, v) < kSeenSd_m;
    tally.touching += r.contact(row, v) != 0;
    if (r.true_m.empty()) continue;
    const Eigen::Vector3f truth = r.true_m[f].row(v), found = r.fine_m[f].row(v);
    ++tally.with_truth;
    tally.drift_m += (found - truth).norm();
    const bool is = truth.z() < contact::kContactGap_m;
    tally.true_contact += is;
    tally.said += r.contact(row, v) != 0;
    tally.both += is && r.contact(row, v) != 0;
  }
}

double Share(double part, long whole) { return whole > 0 ? part / static_cast<double>(whole) : 0; }

}  // namespace

json DatasetInfo(const std::filesystem::path& dataset) {
  std::map<std::string, int> splits{{"train", 0}, {"validation", 0}, {"test", 0}}, sexes, sides,
      frames{{"train", 0}, {"validation", 0}, {"test", 0}}, motions, verdicts;
  Tally tally;
  int feet = 0, all = 0, good = 0;
  for (const std::filesystem::path& path : ListRegistrations(dataset)) {
    const SubjectRegistrations r = ReadRegistrations(path);
    ++feet;
    ++splits[r.split];
    ++sexes[r.sex.empty() ? "not stated" : r.sex];
    ++sides[r.side == Side::kLeft ? "left" : "right"];
    for (std::size_t f = 0; f < r.NumFrames(); ++f) {
      ++all;
      ++frames[r.split];
      ++motions[r.motion[static_cast<std::size_t>(r.sequence[f])]];
      ++verdicts[r.verdict[f].substr(0, r.verdict[f].find(':'))];
      if (r.verdict[f] != "good") continue;
      ++good;
      AddFrame(r, f, tally);
    }
  }
  json truth = nullptr;
  if (tally.with_truth > 0) {
    truth = {{"distance_mm", 1e3 * Share(tally.drift_m, tally.with_truth)},
             {"contact_precision", Share(static_cast<double>(tally.both), tally.said)},
             {"contact_recall", Share(static_cast<double>(tally.both), tally.true_contact)}};
  }
  return {{"feet", feet},
          {"feet_by_split", splits},
          {"feet_by_sex", sexes},
          {"feet_by_side", sides},
          {"frames", all},
          {"frames_good", good},
          {"frames_by_split", frames},
          {"frames_by_motion", motions},
          {"frames_by_verdict", verdicts},
          {"vertices_seen", Share(static_cast<double>(tally.seen), tally.vertices)},
          {"vertices_touching", Share(static_cast<double>(tally.touching), tally.vertices)},
          {"truth", truth}};
}

std::string FormatDatasetInfo(const json& info) {
  const auto counts = [](const json& by) {
    std::string line;
    for (const auto& [name, count] : by.items())
      line += fmt::format("{}{} {}", line.empty() ? "" : ", ", name, count.get<int>());
    return line;
  };
  std::string text = fmt::format(
      "feet: {} ({}; {}; {})\nframes: {}, of them good {} ({})\nmotions: {}\nverdicts: {}\n"
      "vertices of good frames: {:.1f} % seen, {:.1f} % touching\n",
      info["feet"].get<int>(), counts(info["feet_by_split"]), counts(info["feet_by_sex"]),
      counts(info["feet_by_side"]), info["frames"].get<int>(), info["frames_good"].get<int>(),
      counts(info["frames_by_split"]), counts(info["frames_by_motion"]),
      counts(info["frames_by_verdict"]), 100 * info["vertices_seen"].get<double>(),
      100 * info["vertices_touching"].get<double>());
  if (const json& truth = info["truth"]; !truth.is_null()) {
    text += fmt::format(
        "against the truth: registered vertices {:.3f} mm off, contact precision {:.3f}, recall "
        "{:.3f}\n",
        truth["distance_mm"].get<double>(), truth["contact_precision"].get<double>(),
        truth["contact_recall"].get<double>());
  }
  return text;
}

}  // namespace sole::app
