#include <cmath>
#include <optional>
#include <utility>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/console.h"
#include "app/stages.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/calibration_file.h"
#include "io/mesh_file.h"
#include "io/take.h"
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

}  // namespace

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

}  // namespace sole::app
