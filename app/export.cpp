#include <algorithm>
#include <functional>
#include <utility>

#include <fmt/format.h>

#include "app/stages.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/glb.h"
#include "io/mesh_file.h"
#include "io/npz.h"
#include "io/take.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;

/// What exporters get: the registered surface of every frame that has a foot.
struct ExportFrames {
  std::vector<std::int64_t> triggers;  ///< one per frame of the animation
  io::MeshAnimation animation;
};

TriangleMesh FirstMesh(const ExportFrames& frames) {
  TriangleMesh mesh{{}, frames.animation.triangles};
  for (const auto& vertex : frames.animation.frames.front().rowwise()) mesh.vertices.push_back(vertex);
  return mesh;
}

void ExportCsv(const fs::path& path, const ExportFrames& frames) {
  std::string text = "# Sole export, format 1: registered vertices of every frame; metres, world frame (z = 0 is the glass top)\n"
                     "frame,vertex,x_m,y_m,z_m\n";
  for (std::size_t f = 0; f < frames.triggers.size(); ++f) {
    const Eigen::MatrixX3d& vertices = frames.animation.frames[f];
    for (Eigen::Index v = 0; v < vertices.rows(); ++v) {
      text += fmt::format("{},{},{:.6f},{:.6f},{:.6f}\n", frames.triggers[f], v, vertices(v, 0), vertices(v, 1), vertices(v, 2));
    }
  }
  io::WriteStringAtomically(path, text);
}

void ExportNpz(const fs::path& path, const ExportFrames& frames) {
  std::vector<double> positions;
  for (const Eigen::MatrixX3d& frame : frames.animation.frames) {
    for (const auto& p : frame.rowwise()) positions.insert(positions.end(), {p.x(), p.y(), p.z()});
  }
  std::vector<int> triangles, triggers;
  for (const Eigen::Vector3i& t : frames.animation.triangles) triangles.insert(triangles.end(), {t[0], t[1], t[2]});
  for (const std::int64_t t : frames.triggers) triggers.push_back(static_cast<int>(t));
  const auto count = static_cast<std::size_t>(frames.animation.frames.front().rows());
  io::WriteNpz(path, {{"format", io::NpyFrom(std::string("sole-export"))},
                      {"version", io::NpyFrom(std::vector<int>{1})},
                      {"units", io::NpyFrom(std::string("metres"))},
                      {"frames", io::NpyFrom(triggers)},
                      {"triangles", io::Reshaped(io::NpyFrom(triangles), {frames.animation.triangles.size(), 3})},
                      {"vertices_m", io::Reshaped(io::NpyFrom(positions), {frames.triggers.size(), count, 3})}});
}

ExportFrames FramesOf(const FitSequence& fit, const ModelPair& models) {
  ExportFrames frames;
  for (const FrameFit& frame : fit.frames) {
    if (!frame.found) continue;
    const model::FootModel& model = frame.side == Side::kRight ? models.right : models.left;
    const bool fine = frame.registration_fine_m.rows() > 0;
    frames.animation.triangles =
        model::TemplateMesh(model, fine ? model::Variant::kFine : model::Variant::kCoarse).triangles;
    frames.animation.frames.push_back(fine ? frame.registration_fine_m : frame.registration_m);
    frames.triggers.push_back(frame.trigger);
  }
  return frames;
}

using Exporter = std::function<void(const fs::path&, const ExportFrames&)>;

/// A new format is one line here and one writer in io/.
const std::vector<std::pair<std::string, Exporter>>& Exporters() {
  static const std::vector<std::pair<std::string, Exporter>> exporters{
      {"glb", [](const fs::path& path, const ExportFrames& f) { io::WriteGlb(path, f.animation); }},
      {"obj", [](const fs::path& path, const ExportFrames& f) { io::WriteObj(path, FirstMesh(f)); }},
      {"stl", [](const fs::path& path, const ExportFrames& f) { io::WriteStl(path, FirstMesh(f)); }},
      {"csv", ExportCsv},
      {"npz", ExportNpz}};
  return exporters;
}

}  // namespace

const std::vector<std::string>& ExportFormats() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> list;
    for (const auto& [name, exporter] : Exporters()) list.push_back(name);
    return list;
  }();
  return names;
}

std::vector<fs::path> RunExport(const fs::path& directory, const ModelPair& models, const std::string& format) {
  const auto exporter = std::find_if(Exporters().begin(), Exporters().end(),
                                     [&](const auto& entry) { return entry.first == format; });
  if (exporter == Exporters().end()) {
    throw Error(fmt::format("unknown export format '{}': use {}", format, fmt::join(ExportFormats(), ", ")));
  }
  const io::TakePaths take{directory};
  Require(fs::exists(take.Fit()), take.Fit().string() + " is missing: run `sole fit " + directory.string() + "` first");
  io::MakeDirectory(take.Exports());
  const std::string name = fs::absolute(directory).lexically_normal().filename().string();
  const double rate_hz = io::TakeReader(directory).Config().trigger.rate_hz;
  std::vector<fs::path> paths;
  for (int foot = 1; foot == 1 || fs::exists(OfFoot(take.Fit(), foot)); ++foot) {
    ExportFrames frames = FramesOf(io::ReadFit(OfFoot(take.Fit(), foot)), models);
    frames.animation.rate_hz = rate_hz;
    Require(!frames.triggers.empty() || foot > 1, "no frame of " + directory.string() + " has a fitted foot: nothing to export");
    if (frames.triggers.empty()) continue;
    paths.push_back(OfFoot(take.Exports() / ((name.empty() ? "take" : name) + "." + format), foot));
    exporter->second(paths.back(), frames);
  }
  return paths;
}

}  // namespace sole::app
