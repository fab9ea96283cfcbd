#include "app/stages.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/console.h"
#include "app/fit_labels.h"
#include "app/fit_sequences.h"
#include "app/fit_sheet.h"
#include "contact/ground.h"
#include "contact/label.h"
#include "contact/temporal.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/calibration_file.h"
#include "io/mesh_file.h"
#include "io/take.h"
#include "model/measure.h"
#include "model/mirror.h"
#include "model/model_file.h"
#include "recon/reconstruct.h"
#include "recon/surface_mesh.h"
#include "recon/texture.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

json PairJson(const recon::PairStats& pair) {
  return {{"name", pair.name},           {"tried", pair.tried},
          {"matched", pair.matched},     {"kept", pair.kept},
          {"in_cloud", pair.in_cloud},   {"mean_zncc", pair.mean_zncc},
          {"median_gap_px", pair.median_gap_px}, {"seconds", pair.seconds},
          {"offset_mm", 1e3 * pair.offset_m}, {"seeded", pair.seeded},
          {"skipped", pair.skipped}};
}

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

std::vector<std::int64_t> TriggerNumbers(const io::TakePaths& take) {
  std::vector<std::int64_t> triggers;
  for (const io::TriggerRecord& record : io::ReadTriggers(take)) triggers.push_back(record.trigger);
  return triggers;
}

/// The glass top as calibration saw it, by the calibration that the scans were made with; z = 0 without.
GroundSurface CalibratedGround(const io::TakePaths& take) {
  const fs::path path = take.root / "calibration.json";
  return fs::exists(path) ? io::ReadCalibration(path).ground.value_or(GroundSurface{}) : GroundSurface{};
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

/// The texture exposure nearest in time to a trigger; none in takes without any.
class NearestTexture {
 public:
  explicit NearestTexture(const io::TakeReader& reader) : reader_(reader) {}

  const FrameSet* To(std::size_t trigger) {
    const std::vector<io::TriggerRecord>& all = reader_.Triggers();
    std::optional<std::size_t> best;
    const auto apart = [&](std::size_t i) { return std::abs(all[i].actual_s - all[trigger].actual_s); };
    for (std::size_t i = 0; i < all.size(); ++i) {
      if (all[i].kind == ExposureKind::kTexture && (!best || apart(i) < apart(*best))) best = i;
    }
    if (best && (!frame_ || read_ != *best)) {
      frame_ = reader_.Read(*best);
      read_ = *best;
    }
    return best ? &*frame_ : nullptr;
  }

 private:
  const io::TakeReader& reader_;
  std::optional<FrameSet> frame_;
  std::size_t read_ = 0;
};

/// True if `output` is missing or older than one of the inputs.
bool Stale(const fs::path& output, const std::vector<fs::path>& inputs) {
  if (!fs::exists(output)) return true;
  return std::any_of(inputs.begin(), inputs.end(), [&](const fs::path& input) {
    return fs::exists(input) && fs::last_write_time(input) > fs::last_write_time(output);
  });
}

}  // namespace

ModelPair LoadModelPair(const fs::path& path) {
  model::FootModel loaded = model::LoadModel(path);
  model::FootModel mirrored = model::MirrorModel(loaded);
  if (loaded.side == Side::kRight) return {std::move(loaded), std::move(mirrored)};
  return {std::move(mirrored), std::move(loaded)};
}

fs::path DefaultModelPath() {
  const fs::path name = fs::path("models") / "sole-foot.npz";
  if (const char* folder = std::getenv("SOLE_MODELS")) return fs::path(folder) / name.filename();
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  for (fs::path folder = program.parent_path(); folder.has_relative_path(); folder = folder.parent_path()) {
    if (fs::exists(folder / name)) return folder / name;
  }
  return name;
}

fs::path OfFoot(const fs::path& first, int foot) {
  return foot == 1 ? first : first.parent_path() / fmt::format("{}_{}{}", first.stem().string(), foot, first.extension().string());
}

json RunReconstruct(const fs::path& directory, const fs::path& calibration_path, ScanMesh mesh) {
  const io::TakePaths take{directory};
  const io::TakeReader reader(directory, Log);
  const Calibration calibration = io::ReadCalibration(calibration_path);
  Require(calibration.rig.rig_hash == RigIdentityHash(reader.Config()),
          fmt::format("{} is the calibration of another rig than {}: record a calibration take with this rig and "
                      "run `sole calibrate` on it",
                      calibration_path.string(), directory.string()));
  const recon::Reconstructor reconstructor(calibration.rig);
  io::MakeDirectory(take.Scan(1).parent_path());
  io::MakeDirectory(take.Platform(1).parent_path());
  fs::remove_all(take.ScanMesh(1).parent_path());
  if (mesh != ScanMesh::kNone) io::MakeDirectory(take.ScanMesh(1).parent_path());
  recon::MeshOptions mesh_options;
  if (mesh == ScanMesh::kWatertight) mesh_options.trim_m = 0;
  NearestTexture texture(reader);

  json frames = json::array();
  double seconds = 0, points = 0;
  int empty = 0;
  recon::FrameSeeds seeds;  // of the speckle frame before
  const int count = static_cast<int>(reader.Triggers().size());
  Progress progress("reconstruct", count);
  for (int i = 0; i < count; ++i) {
    const FrameSet frame = reader.Read(static_cast<std::size_t>(i));
    recon::FrameReconstruction result = reconstructor.Reconstruct(frame, &seeds);
    if (frame.kind == ExposureKind::kSpeckle) seeds = std::move(result.seeds);
    const FrameSet* skin = result.cloud.Size() > 0 ? texture.To(static_cast<std::size_t>(i)) : nullptr;
    if (skin) result.cloud.intensity = recon::TextureIntensity(result.cloud, calibration.rig, *skin);
    io::WritePly(take.Scan(frame.trigger), result.cloud);
    if (mesh != ScanMesh::kNone)
      io::WritePly(take.ScanMesh(frame.trigger), recon::MeshFromCloud(result.cloud, mesh_options));
    io::WritePly(take.Platform(frame.trigger), result.platform);
    json pieces = json::array();
    for (const recon::CloudPiece& piece : result.pieces) {
      pieces.push_back({{"points", piece.points},
                        {"min_m", {piece.min_m.x(), piece.min_m.y(), piece.min_m.z()}},
                        {"max_m", {piece.max_m.x(), piece.max_m.y(), piece.max_m.z()}}});
    }
    for (const std::string& warning : result.warnings) Log(fmt::format("trigger {}: {}", frame.trigger, warning));
    json pairs = json::array();
    for (const recon::PairStats& pair : result.pairs) {
      pairs.push_back(PairJson(pair));
      if (!pair.skipped.empty()) {
        Log(fmt::format("trigger {}, pair {}: {}", frame.trigger, pair.name, pair.skipped));
      }
    }
    frames.push_back({{"trigger", frame.trigger}, {"points", result.cloud.Size()},
                      {"platform_points", result.platform.Size()}, {"seconds", result.seconds}, {"pieces", pieces},
                      {"warnings", result.warnings}, {"pairs", pairs}});
    seconds += result.seconds;
    points += static_cast<double>(result.cloud.Size());
    empty += result.cloud.Size() == 0;
    progress.Set(i + 1);
  }
  if (fs::absolute(calibration_path) != fs::absolute(directory / "calibration.json")) {
    io::WriteCalibration(directory / "calibration.json", calibration);
  }
  const auto per_frame = [count](double sum) { return count ? json(sum / count) : json(nullptr); };
  const json stats{{"format_version", 1}, {"seconds_per_frame", per_frame(seconds)}, {"frames", frames}};
  io::WriteStringAtomically(take.ReconstructionStats(), stats.dump(2) + "\n");
  return {{"frames", count}, {"frames_without_foot", empty}, {"points_mean", per_frame(points)}, {"seconds_per_frame", per_frame(seconds)}};
}

json RunContact(const fs::path& directory) {
  const io::TakePaths take{directory};
  io::ContactFile file;
  const GroundSurface calibrated = CalibratedGround(take);
  for (const std::int64_t trigger : TriggerNumbers(take)) {
    Require(fs::exists(take.Platform(trigger)), take.Platform(trigger).string() + " is missing: run `sole reconstruct " +
                                                    directory.string() + "` first");
    file.triggers.push_back(trigger);
    file.ground.push_back(contact::EstimateGround(io::ReadPlyCloud(take.Platform(trigger)), calibrated));
  }
  io::WriteContact(take.Contact(), file);
  double offset = 0, points = 0;
  for (const GroundPlane& ground : file.ground) offset += ground.offset_m, points += ground.points;
  const auto count = static_cast<double>(file.ground.size());
  return {{"frames", file.ground.size()}, {"plane_offset_mm", count > 0 ? json(1e3 * offset / count) : json(nullptr)},
          {"platform_points", count > 0 ? json(points / count) : json(nullptr)}};
}

namespace {

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

/// Files of feet that an earlier run found.
void RemoveFrom(int foot, const fs::path& first) {
  while (fs::remove(OfFoot(first, foot))) ++foot;
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

json RunMeasure(const fs::path& directory, const ModelPair& models) {
  const io::TakePaths take{directory};
  Require(fs::exists(take.Fit()), take.Fit().string() + " is missing: run `sole fit " + directory.string() + "` first");
  json account = json::object();
  int feet = 0;
  for (int foot = 1; foot == 1 || fs::exists(OfFoot(take.Fit(), foot)); ++foot, ++feet) {
    const FitSequence fit = io::ReadFit(OfFoot(take.Fit(), foot));
    const io::ContactFile contact = io::ReadContact(OfFoot(take.Contact(), foot));
    std::vector<io::Measurement> rows;
    std::map<std::string, std::pair<double, int>> sums;
    for (std::size_t f = 0; f < fit.frames.size(); ++f) {
      const FrameFit& frame = fit.frames[f];
      const model::FootModel& model = frame.side == Side::kRight ? models.right : models.left;
      if (!model::StandsOnGround(model, frame, contact.ground.at(f))) continue;
      for (const model::FootMeasure& m : model::MeasureFrame(model, frame, contact.ground.at(f))) {
        rows.push_back({frame.trigger, m.name, 1e3 * m.value_m, "mm", 1e3 * m.sd_m, 1});
        sums[m.name].first += 1e3 * m.value_m;
        ++sums[m.name].second;
      }
    }
    if (rows.empty()) Log("no frame of " + directory.string() + " shows a foot that stands, heel and ball down: nothing to measure");
    io::WriteMeasurements(OfFoot(take.Measurements(), foot), rows);
    json means = json::object();
    for (const auto& [name, sum] : sums) means[name + "_mm"] = sum.first / sum.second;
    if (foot == 1) account = means;
    else account[fmt::format("foot_{}", foot)] = means;
  }
  RemoveFrom(feet + 1, take.Measurements());
  return account;
}

json RunProcess(const fs::path& directory, const fs::path& calibration, const fs::path& model_path) {
  const io::TakePaths take{directory};
  const fs::path own = directory / "calibration.json";
  const fs::path used = calibration.empty() ? own : calibration;
  Require(fs::exists(used), used.string() + " does not exist: give --calibration FILE (made by `sole calibrate`)");
  const ModelPair models = LoadModelPair(model_path);
  json account = json::object();
  if (Stale(take.ReconstructionStats(), {take.Info(), used})) account["reconstruct"] = RunReconstruct(directory, used);
  const bool refit = Stale(take.Fit(), {take.ReconstructionStats(), model_path});
  if (refit || Stale(take.Contact(), {take.ReconstructionStats()})) account["contact"] = RunContact(directory);
  if (refit) account["fit"] = RunFit({directory}, models);
  if (Stale(take.Measurements(), {take.Fit()})) account["measure"] = RunMeasure(directory, models);
  for (const std::string& format : ExportFormats()) {
    const std::vector<fs::path> files = RunExport(directory, models, format);
    account["export"][format] = files.front().string();
    for (std::size_t k = 1; k < files.size(); ++k)
      account["export"][fmt::format("{}_{}", format, k + 1)] = files[k].string();
  }
  return account;
}

}  // namespace sole::app
