#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/console.h"
#include "app/fit_labels.h"
#include "app/fit_sequences.h"
#include "app/fit_sheet.h"
#include "app/stages.h"
#include "app/stages_internal.h"
#include "contact/label.h"
#include "contact/temporal.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/mesh_file.h"
#include "io/take.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// Clouds of every trigger, in order. Throws Error if a scan is missing.
std::vector<PointCloud> ReadScans(const io::TakePaths& take, const std::vector<std::int64_t>& triggers) {
  std::vector<PointCloud> clouds;
  for (const std::int64_t trigger : triggers) {
    Require(fs::exists(take.Scan(trigger)),
            take.Scan(trigger).string() + " is missing: run `sole reconstruct " + take.root.string() + "` first");
    clouds.push_back(io::ReadPlyCloud(take.Scan(trigger)));
  }
  return clouds;
}

/// Mean over the frames that have the value; null without any.
json MeanInMm(const std::vector<FrameContact>& frames, double FrameContact::*value) {
  double sum = 0;
  int count = 0;
  for (const FrameContact& frame : frames) {
    if (std::isnan(frame.*value)) continue;
    sum += frame.*value;
    ++count;
  }
  return count ? json(1e3 * sum / count) : json(nullptr);
}

/// One take as the fit reads it.
struct FitTake {
  io::TakePaths paths;
  std::string subject;
  io::ContactFile contact;
  GroundSurface calibrated;
};

FitTake OpenForFit(const fs::path& directory, TakeClouds& scans) {
  FitTake take{io::TakePaths{directory}, io::ReadTakeInfo(io::TakePaths{directory}).subject, {}, {}};
  take.calibrated = CalibratedGround(take.paths);
  scans.triggers = TriggerNumbers(take.paths);
  scans.clouds = ReadScans(take.paths, scans.triggers);
  Require(fs::exists(take.paths.Contact()),
          take.paths.Contact().string() + " is missing: run `sole contact " + directory.string() + "` first");
  take.contact = io::ReadContact(take.paths.Contact());
  take.contact.contact.clear();
  Require(take.contact.triggers == scans.triggers, take.paths.Contact().string() + " has other frames than the take: run `sole contact " +
                                                       directory.string() + "` again");
  return take;
}

json FootAccount(const FitSequence& fit, const std::vector<FrameContact>& contact) {
  const auto first = std::find_if(fit.frames.begin(), fit.frames.end(), [](const FrameFit& f) { return f.found; });
  const auto count_if = [&](auto condition) { return std::count_if(fit.frames.begin(), fit.frames.end(), condition); };
  return {{"frames", fit.frames.size()},
          {"found", count_if([](const FrameFit& f) { return f.found; })},
          {"good", count_if([](const FrameFit& f) { return f.verdict == "good"; })},
          {"side", first == fit.frames.end() ? json(nullptr) : json(first->side == Side::kLeft ? "left" : "right")},
          {"slip_mm", MeanInMm(contact, &FrameContact::slip_m)},
          {"penetration_mm", MeanInMm(contact, &FrameContact::penetration_m)}};
}

/// Labels a foot and writes its files. Returns its account.
json FinishFoot(const FitTake& take, const ModelPair& models, int foot, const FootFit& fitted) {
  io::ContactFile contact = take.contact;
  contact.contact = LabelFit(models, fitted.fit, fitted.clouds, contact.ground, take.calibrated);
  std::vector<Eigen::MatrixX3d> registered;
  for (const FrameFit& frame : fitted.fit.frames) {
    registered.push_back(frame.registration_m);
    // Further feet are away most of the time.
    if (frame.verdict != "good" && (foot == 1 || frame.found))
      Log(fmt::format("{}trigger {}: {}", foot == 1 ? "" : fmt::format("foot {}, ", foot), frame.trigger, frame.verdict));
  }
  contact::SmoothLabels(contact.contact);
  contact::MeasureSlip(registered, contact.contact);
  io::WriteFit(OfFoot(take.paths.Fit(), foot), fitted.fit);
  io::WriteContact(OfFoot(take.paths.Contact(), foot), contact);
  return FootAccount(fitted.fit, contact.contact);
}

}  // namespace

json RunFit(const std::vector<fs::path>& directories, const ModelPair& models) {
  std::vector<TakeClouds> scans(directories.size());
  std::vector<FitTake> takes;
  std::size_t frames = 0;
  for (std::size_t t = 0; t < directories.size(); ++t) {
    takes.push_back(OpenForFit(directories[t], scans[t]));
    Require(takes[t].subject == takes[0].subject,
            fmt::format("takes fitted together share one shape, but {} is of subject '{}' and {} of '{}': fit each subject's takes apart",
                        directories[0].string(), takes[0].subject, directories[t].string(), takes[t].subject));
    frames += scans[t].triggers.size();
  }
  for (std::size_t t = 0; t < takes.size(); ++t) {
    scans[t].label_contact = [&take = takes[t], &clouds = scans[t].clouds](
                                 const Eigen::MatrixX3d& registered_m, const Eigen::VectorXd& sd_m,
                                 const Eigen::MatrixX3d& undeformed_m, std::size_t f) {
      return contact::LabelContact({registered_m, sd_m, undeformed_m, clouds[f]}, take.contact.ground[f], take.calibrated)
          .probability;
    };
  }
  const Stopwatch watch;
  Progress progress("fit", static_cast<int>(frames));
  const std::vector<std::vector<FootFit>> fits =
      FitTakes(scans, models, [&](int done, int all) { progress.Set(done * static_cast<int>(frames) / std::max(all, 1)); }, Log);
  progress.Set(static_cast<int>(frames));
  const json seconds = frames == 0 ? json(nullptr) : json(watch.Seconds() / static_cast<double>(frames));
  json accounts = json::array();
  for (std::size_t t = 0; t < takes.size(); ++t) {
    const io::TakePaths& paths = takes[t].paths;
    json account;
    for (std::size_t k = 0; k < fits[t].size(); ++k) {
      const json foot = FinishFoot(takes[t], models, static_cast<int>(k) + 1, fits[t][k]);
      if (k == 0) account = foot;
      if (fits[t].size() > 1) account["feet"].push_back(foot);
    }
    for (const fs::path& file : {paths.Fit(), paths.Contact()}) RemoveFrom(static_cast<int>(fits[t].size()) + 1, file);
    WriteFitSheet(paths.root / "fit-sheet.png", models, fits[t]);
    account["seconds_per_frame"] = seconds;
    io::WriteStringAtomically(paths.root / "fit.json", json{{"format_version", 1}, {"seconds_per_frame", seconds}}.dump(2) + "\n");
    if (takes.size() > 1) account["take"] = paths.root.string();
    accounts.push_back(account);
  }
  return takes.size() == 1 ? accounts[0] : json{{"takes", accounts}};
}

}  // namespace sole::app
