#include "app/truth.h"

#include <utility>

#include "core/error.h"
#include "io/mesh_file.h"
#include "io/npz.h"
#include "io/take.h"

namespace sole::app {
namespace {

/// Our names of measures and the names that the survey gives them.
const std::map<std::string, std::string>& SurveyNames() {
  static const std::map<std::string, std::string> names{{"length", "footlength"},
                                                        {"ball_width", "footbreadthhorizontal"},
                                                        {"heel_width", "heelbreadth"},
                                                        {"instep_height", "instep_height"},
                                                        {"arch_height", "arch_height"}};
  return names;
}

/// The sagged glass of every frame; rigid where the file has none.
std::vector<sim::PlateSag> ReadSag(const io::Npz& npz, std::size_t frames, const std::string& path) {
  std::vector<sim::PlateSag> sags(frames);
  if (!npz.contains("plate_sag_grid_m")) return sags;
  const std::vector<std::size_t> shape = io::ShapeOf(npz, "plate_sag_grid_m");
  const Eigen::MatrixXd x = io::MatrixFrom(npz, "plate_sag_x_m"), y = io::MatrixFrom(npz, "plate_sag_y_m");
  Require(shape.size() == 3 && shape[0] == frames && shape[1] == static_cast<std::size_t>(y.size()) &&
              shape[2] == static_cast<std::size_t>(x.size()) && shape[1] > 1 && shape[2] > 1,
          path + ": 'plate_sag_grid_m' does not fit 'frames' and its nodes");
  const Eigen::MatrixXd values = io::MatrixFrom(npz, "plate_sag_grid_m");
  for (std::size_t f = 0; f < frames; ++f) {
    const Eigen::VectorXd row = values.row(static_cast<Eigen::Index>(f));
    sags[f] = {x.maxCoeff() - x.minCoeff(), y.maxCoeff() - y.minCoeff(), static_cast<int>(shape[2]), static_cast<int>(shape[1]),
               {row.begin(), row.end()}};
  }
  return sags;
}

}  // namespace

TakeTruth ReadTruth(const std::filesystem::path& directory) {
  const io::TakePaths take{directory};
  Require(std::filesystem::exists(take.Truth()),
          directory.string() + " has no truth/: only simulated takes can be scored");
  const io::Npz npz = io::ReadNpz(take.Truth());
  TakeTruth truth;
  truth.side = io::StringFrom(npz, "side") == "left" ? Side::kLeft : Side::kRight;
  const std::vector<int> triggers = io::IntsFrom(npz, "frames");
  const std::vector<std::size_t>& shape = io::ShapeOf(npz, "visible");  // frames, pairs, vertices
  Require(shape.size() == 3 && shape[0] == triggers.size(),
          take.Truth().string() + ": 'visible' does not fit 'frames'");
  const std::vector<std::uint8_t>& visible = npz.at("visible").bytes;
  Require(visible.size() == shape[0] * shape[1] * shape[2], take.Truth().string() + ": 'visible' is not of bytes");
  const std::vector<sim::PlateSag> sags = ReadSag(npz, triggers.size(), take.Truth().string());
  for (std::size_t f = 0; f < triggers.size(); ++f) {
    FrameTruth frame;
    frame.sag = sags[f];
    frame.trigger = triggers[f];
    frame.mesh = io::ReadPlyMesh(take.TruthMesh(frame.trigger));
    Require(frame.mesh.vertices.size() == shape[2], take.TruthMesh(frame.trigger).string() +
                                                        " has another number of vertices than truth.npz");
    for (std::size_t p = 0; p < shape[1]; ++p) {
      const auto first = visible.begin() + static_cast<std::ptrdiff_t>((f * shape[1] + p) * shape[2]);
      frame.visible.emplace_back(first, first + static_cast<std::ptrdiff_t>(shape[2]));
    }
    truth.frames.push_back(std::move(frame));
  }
  for (const auto& [name, survey_name] : SurveyNames()) {
    const std::string key = "measure_" + survey_name;
    if (npz.contains(key)) truth.measures_mm[name] = io::MatrixFrom(npz, key)(0, 0);
  }
  return truth;
}

std::vector<Eigen::Vector3d> MaterialPositions(const model::FootModel& model, const TriangleMesh& truth, Side side) {
  std::vector<Eigen::Vector3d> positions;
  for (SurfacePoint point : model.material) {
    // A left foot is the mirrored right one: its triangles are turned over by exchanging their last two corners.
    if (side == Side::kLeft) std::swap(point.barycentric[1], point.barycentric[2]);
    positions.push_back(PositionOf(truth, point));
  }
  return positions;
}

}  // namespace sole::app
