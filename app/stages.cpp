#include "app/stages.h"

#include <algorithm>
#include <cstdlib>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/console.h"
#include "app/stages_internal.h"
#include "contact/ground.h"
#include "core/error.h"
#include "io/calibration_file.h"
#include "io/mesh_file.h"
#include "io/take.h"
#include "model/measure.h"
#include "model/mirror.h"
#include "model/model_file.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// True if `output` is missing or older than one of the inputs.
bool Stale(const fs::path& output, const std::vector<fs::path>& inputs) {
  if (!fs::exists(output)) return true;
  return std::any_of(inputs.begin(), inputs.end(), [&](const fs::path& input) {
    return fs::exists(input) && fs::last_write_time(input) > fs::last_write_time(output);
  });
}

}  // namespace

std::vector<std::int64_t> TriggerNumbers(const io::TakePaths& take) {
  std::vector<std::int64_t> triggers;
  for (const io::TriggerRecord& record : io::ReadTriggers(take)) triggers.push_back(record.trigger);
  return triggers;
}

GroundSurface CalibratedGround(const io::TakePaths& take) {
  const fs::path path = take.root / "calibration.json";
  return fs::exists(path) ? io::ReadCalibration(path).ground.value_or(GroundSurface{}) : GroundSurface{};
}

void RemoveFrom(int foot, const fs::path& first) {
  while (fs::remove(OfFoot(first, foot))) ++foot;
}

ModelPair LoadModelPair(const fs::path& path) {
  model::FootModel loaded = model::LoadModel(path);
  model::FootModel mirrored = model::MirrorModel(loaded);
  if (loaded.side == Side::kRight) return {std::move(loaded), std::move(mirrored)};
  return {std::move(mirrored), std::move(loaded)};
}

namespace {

fs::path ShippedModel(const char* file) {
  const fs::path name = fs::path("models") / file;
  if (const char* folder = std::getenv("SOLE_MODELS")) return fs::path(folder) / name.filename();
  std::error_code ignored;
  const fs::path program = fs::read_symlink("/proc/self/exe", ignored);
  for (fs::path folder = program.parent_path(); folder.has_relative_path(); folder = folder.parent_path()) {
    if (fs::exists(folder / name)) return folder / name;  // run from the build tree
    if (fs::exists(folder / "share/sole" / name)) return folder / "share/sole" / name;  // installed
  }
  return name;
}

}  // namespace

fs::path DefaultModelPath() { return ShippedModel("sole-foot-contact.npz"); }

fs::path DefaultTemplatePath() { return ShippedModel("sole-foot.npz"); }

fs::path OfFoot(const fs::path& first, int foot) {
  return foot == 1 ? first : first.parent_path() / fmt::format("{}_{}{}", first.stem().string(), foot, first.extension().string());
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
