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
  std::vector<Eigen::Vector3i> triangles;
  std::vector<std::int64_t> triggers;
  std::vector<std::vector<Eigen::Vector3d>> vertices;
  double rate_hz = 10;
  const FitSequence* fit = nullptr;
};

TriangleMesh FirstMesh(const ExportFrames& frames) { return {frames.vertices.front(), frames.triangles}; }

void ExportCsv(const fs::path& path, const ExportFrames& frames) {
  std::string text = "# Sole export, format 1: registered vertices of every frame; metres, world frame (z = 0 is the glass top)\n"
                     "frame,vertex,x_m,y_m,z_m\n";
  for (std::size_t f = 0; f < frames.vertices.size(); ++f) {
    for (std::size_t v = 0; v < frames.vertices[f].size(); ++v) {
      const Eigen::Vector3d& p = frames.vertices[f][v];
      text += fmt::format("{},{},{:.6f},{:.6f},{:.6f}\n", frames.triggers[f], v, p.x(), p.y(), p.z());
    }
  }
  io::WriteStringAtomically(path, text);
}

void ExportNpz(const fs::path& path, const ExportFrames& frames) {
  std::vector<double> positions;
  for (const auto& frame : frames.vertices) {
    for (const Eigen::Vector3d& p : frame) positions.insert(positions.end(), {p.x(), p.y(), p.z()});
  }
  std::vector<int> triangles, triggers;
  for (const Eigen::Vector3i& t : frames.triangles) triangles.insert(triangles.end(), {t[0], t[1], t[2]});
  for (const std::int64_t t : frames.triggers) triggers.push_back(static_cast<int>(t));
  const std::size_t count = frames.vertices.front().size();
  io::WriteNpz(path, {{"format", io::NpyFrom(std::string("sole-export"))},
                      {"version", io::NpyFrom(std::vector<int>{1})},
                      {"units", io::NpyFrom(std::string("metres"))},
                      {"frames", io::NpyFrom(triggers)},
                      {"triangles", io::Reshaped(io::NpyFrom(triangles), {frames.triangles.size(), 3})},
                      {"vertices_m", io::Reshaped(io::NpyFrom(positions), {frames.vertices.size(), count, 3})}});
}

using Exporter = std::function<void(const fs::path&, const ExportFrames&)>;

/// A new format is one line here and one writer in io/.
const std::vector<std::pair<std::string, Exporter>>& Exporters() {
  static const std::vector<std::pair<std::string, Exporter>> exporters{
      {"glb", [](const fs::path& path, const ExportFrames& f) { io::WriteGlb(path, f.triangles, f.vertices, f.rate_hz); }},
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

fs::path RunExport(const fs::path& directory, const ModelPair& models, const std::string& format) {
  const auto exporter = std::find_if(Exporters().begin(), Exporters().end(),
                                     [&](const auto& entry) { return entry.first == format; });
  if (exporter == Exporters().end()) {
    throw Error(fmt::format("unknown export format '{}': use {}", format, fmt::join(ExportFormats(), ", ")));
  }
  const io::TakePaths take{directory};
  Require(fs::exists(take.Fit()), take.Fit().string() + " is missing: run `sole fit " + directory.string() + "` first");
  const FitSequence fit = io::ReadFit(take.Fit());
  ExportFrames frames;
  frames.fit = &fit;
  frames.rate_hz = io::TakeReader(directory).Config().trigger.rate_hz;
  for (const FrameFit& frame : fit.frames) {
    if (!frame.found) continue;
    const model::FootModel& model = frame.side == Side::kRight ? models.right : models.left;
    const bool fine = frame.registration_fine_m.rows() > 0;
    const Eigen::MatrixX3d& vertices = fine ? frame.registration_fine_m : frame.registration_m;
    const TriangleMesh mesh = model::MeshOf(model, fine ? model::Variant::kFine : model::Variant::kCoarse, vertices);
    frames.triangles = mesh.triangles;
    frames.vertices.push_back(mesh.vertices);
    frames.triggers.push_back(frame.trigger);
  }
  Require(!frames.vertices.empty(), "no frame of " + directory.string() + " has a fitted foot: nothing to export");
  io::MakeDirectory(take.Exports());
  const std::string name = fs::absolute(directory).lexically_normal().filename().string();
  const fs::path path = take.Exports() / ((name.empty() ? "take" : name) + "." + format);
  exporter->second(path, frames);
  return path;
}

}  // namespace sole::app
