#include "app/evaluate.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <thread>

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "app/console.h"
#include "app/evaluate_fit.h"
#include "app/truth.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/calibration_file.h"
#include "io/mesh_file.h"
#include "io/raw_file.h"
#include "io/take.h"
#include "model/surface_query.h"
#include "model/triangle_topology.h"

namespace sole::app {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

constexpr double kInlier_m = 0.001;  // points further from the surface are outliers

double Percentile(std::vector<double> values, double share) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

double Rms(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

json ScoreCapture(const io::TakePaths& take, const io::TakeReader& reader) {
  const std::size_t cameras = reader.Config().cameras.size(), triggers = reader.Triggers().size();
  std::size_t good = 0;
  for (const CameraConfig& camera : reader.Config().cameras) {
    for (const io::RawRecord& record : io::ReadRawIndex(take.Raw(camera.serial)).records) {
      good += record.header.status == 0 && record.header.trigger >= 1;
    }
  }
  return {{"cameras", cameras},
          {"triggers", triggers},
          {"frames_expected", cameras * triggers},
          {"frames_good", good},
          {"frames_lost", cameras * triggers - std::min(good, cameras * triggers)}};
}

json ScoreCalibration(const io::TakePaths& take) {
  json section{{"reprojection_rms_px", nullptr},
               {"heldout_rms_air_mm", nullptr},
               {"heldout_rms_glass_mm", nullptr},
               {"ground_rms_mm", nullptr}};
  const fs::path path = take.root / "calibration.json";
  if (!fs::exists(path)) return section;
  const CalibrationStats stats = io::ReadCalibration(path).stats;
  section["reprojection_rms_px"] = stats.reprojection_rms_px;
  section["heldout_rms_air_mm"] = stats.heldout_rms_air_mm;
  section["heldout_rms_glass_mm"] = stats.heldout_rms_glass_mm;
  section["ground_rms_mm"] = stats.ground_rms_mm;
  return section;
}

/// What the points of all frames say about reconstruction.
struct SurfaceErrors {
  std::vector<double> distances_m, sole_signed_m;
  std::size_t points = 0, outliers = 0, frames = 0;
  double seen_area = 0, covered_area = 0;
};

/// Signed distance of every point to the surface (positive outside); NaN beyond 10 mm.
std::vector<double> SignedDistances(const TriangleMesh& mesh, const std::vector<Eigen::Vector3f>& points) {
  const model::SurfaceQuery query(mesh);
  const std::vector<Eigen::Vector3d> normals = VertexNormals(mesh);
  std::vector<double> distances(points.size(), std::nan(""));
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), 256), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const Eigen::Vector3d p = points[i].cast<double>();
      const auto hit = query.Closest(p, 0.01);
      if (!hit) continue;
      const Eigen::Vector3i& t = mesh.triangles[static_cast<std::size_t>(hit->point.triangle)];
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      for (int k = 0; k < 3; ++k) normal += hit->point.barycentric[k] * normals[static_cast<std::size_t>(t[k])];
      distances[i] = (p - hit->position).dot(normal) < 0 ? -hit->distance_m : hit->distance_m;
    }
  });
  return distances;
}

/// Which vertices have a point within a millimetre, by a grid of millimetre cells.
std::vector<bool> CoveredVertices(const TriangleMesh& mesh, const std::vector<Eigen::Vector3f>& points) {
  using Cell = std::array<int, 3>;
  const auto cell_of = [](const Eigen::Vector3d& p) {
    return Cell{static_cast<int>(std::floor(p.x() / kInlier_m)), static_cast<int>(std::floor(p.y() / kInlier_m)),
                static_cast<int>(std::floor(p.z() / kInlier_m))};
  };
  std::vector<std::pair<Cell, std::size_t>> cells;
  cells.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) cells.emplace_back(cell_of(points[i].cast<double>()), i);
  std::sort(cells.begin(), cells.end());
  std::vector<bool> covered(mesh.vertices.size(), false);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    const Cell centre = cell_of(mesh.vertices[v]);
    for (int x = -1; x <= 1 && !covered[v]; ++x) {
      for (int y = -1; y <= 1 && !covered[v]; ++y) {
        // Cells of one column are neighbours in the sorted order.
        auto at = std::lower_bound(cells.begin(), cells.end(),
                                   std::pair(Cell{centre[0] + x, centre[1] + y, centre[2] - 1}, std::size_t{0}));
        const Cell last{centre[0] + x, centre[1] + y, centre[2] + 1};
        for (; at != cells.end() && at->first <= last; ++at) {
          if ((points[at->second].cast<double>() - mesh.vertices[v]).squaredNorm() < kInlier_m * kInlier_m) {
            covered[v] = true;
            break;
          }
        }
      }
    }
  }
  return covered;
}

void AddFrame(const FrameTruth& truth, const PointCloud& cloud, const std::vector<bool>& pair_through_glass,
              SurfaceErrors& errors) {
  const std::vector<double> distances = SignedDistances(truth.mesh, cloud.points_m);
  for (std::size_t i = 0; i < distances.size(); ++i) {
    if (!(std::abs(distances[i]) <= kInlier_m)) {
      ++errors.outliers;
      continue;
    }
    errors.distances_m.push_back(std::abs(distances[i]));
    if (!cloud.pair.empty() && pair_through_glass.at(cloud.pair[i])) errors.sole_signed_m.push_back(distances[i]);
  }
  errors.points += cloud.Size();
  ++errors.frames;
  const std::vector<double> areas = model::VertexAreas(truth.mesh);
  const std::vector<bool> covered = CoveredVertices(truth.mesh, cloud.points_m);
  for (std::size_t v = 0; v < areas.size(); ++v) {
    const bool seen = std::any_of(truth.visible.begin(), truth.visible.end(),
                                  [v](const std::vector<std::uint8_t>& pair) { return pair[v] != 0; });
    if (!seen) continue;
    errors.seen_area += areas[v];
    if (covered[v]) errors.covered_area += areas[v];
  }
}

json ScoreReconstruction(const io::TakePaths& take, const io::TakeReader& reader, const TakeTruth& truth) {
  json section{{"points_mean", nullptr},  {"surface_rms_mm", nullptr}, {"surface_p95_mm", nullptr},
               {"sole_rms_mm", nullptr},  {"sole_bias_mm", nullptr},   {"completeness", nullptr},
               {"outliers", nullptr},     {"seconds_per_frame", nullptr}};
  std::vector<bool> through_glass;
  for (const PairConfig& pair : reader.Config().pairs) {
    const auto left = static_cast<std::size_t>(CameraIndex(reader.Config(), pair.left));
    through_glass.push_back(reader.Config().cameras[left].position_m.z() < 0);
  }
  SurfaceErrors errors;
  for (const FrameTruth& frame : truth.frames) {
    if (fs::exists(take.Scan(frame.trigger))) {
      AddFrame(frame, io::ReadPlyCloud(take.Scan(frame.trigger)), through_glass, errors);
    }
  }
  if (errors.frames == 0) return section;
  section["points_mean"] = static_cast<double>(errors.points) / static_cast<double>(errors.frames);
  if (errors.points > 0) section["outliers"] = static_cast<double>(errors.outliers) / static_cast<double>(errors.points);
  if (errors.seen_area > 0) section["completeness"] = errors.covered_area / errors.seen_area;
  if (!errors.distances_m.empty()) {
    section["surface_rms_mm"] = 1e3 * Rms(errors.distances_m);
    section["surface_p95_mm"] = 1e3 * Percentile(errors.distances_m, 0.95);
  }
  if (!errors.sole_signed_m.empty()) {
    Mean bias;
    for (const double d : errors.sole_signed_m) bias.Add(d);
    section["sole_rms_mm"] = 1e3 * Rms(errors.sole_signed_m);
    section["sole_bias_mm"] = bias.Value(1e3);
  }
  if (fs::exists(take.ReconstructionStats())) {
    section["seconds_per_frame"] = json::parse(io::ReadFile(take.ReconstructionStats())).value("seconds_per_frame", json());
  }
  return section;
}

json ScoreMeasurements(const io::TakePaths& take, const TakeTruth& truth) {
  json section{{"length_error_mm", nullptr}, {"ball_width_error_mm", nullptr}};
  if (!fs::exists(take.Measurements())) return section;
  std::map<std::string, Mean> means;
  for (const io::Measurement& m : io::ReadMeasurements(take.Measurements())) {
    if (m.unit == "mm") means[m.name].Add(m.value);
  }
  for (const auto& [name, mean] : means) {
    const auto true_value = truth.measures_mm.find(name);
    if (true_value != truth.measures_mm.end()) {
      section[name + "_error_mm"] = std::abs(mean.Value().get<double>() - true_value->second);
    }
  }
  return section;
}

void FormatValue(const json& value, std::string& text) {
  if (value.is_null()) {
    text += "-";
  } else if (value.is_number_float()) {
    text += fmt::format("{:.4g}", value.get<double>());
  } else {
    text += value.is_string() ? value.get<std::string>() : value.dump();
  }
}

}  // namespace

json EvaluateTake(const fs::path& directory, const std::optional<model::FootModel>& model) {
  const io::TakePaths take{directory};
  const io::TakeReader reader(directory, Log);
  const TakeTruth truth = ReadTruth(directory);
  std::optional<io::ContactFile> contact;
  if (fs::exists(take.Contact())) contact = io::ReadContact(take.Contact());
  std::optional<FitSequence> fitted;
  if (fs::exists(take.Fit())) fitted = io::ReadFit(take.Fit());
  json fit = ScoreFit(fitted, model, truth);
  const fs::path stats = take.root / "fit.json";
  if (fitted && fs::exists(stats)) fit["seconds_per_frame"] = json::parse(io::ReadFile(stats)).value("seconds_per_frame", json());
  return {{"capture", ScoreCapture(take, reader)},
          {"calibration", ScoreCalibration(take)},
          {"reconstruction", ScoreReconstruction(take, reader, truth)},
          {"contact", ScoreContact(contact, model, truth)},
          {"fit", fit},
          {"measure", ScoreMeasurements(take, truth)},
          {"total_seconds", nullptr},
          {"machine", MachineName()}};
}

std::string FormatSummary(const json& summary) {
  std::string text;
  for (const auto& [section, values] : summary.items()) {
    if (!values.is_object()) {
      text += fmt::format("{:<34}", section);
      FormatValue(values, text);
      text += '\n';
      continue;
    }
    for (const auto& [name, value] : values.items()) {
      text += fmt::format("{:<34}", section + "." + name);
      FormatValue(value, text);
      text += '\n';
    }
  }
  return text;
}

std::string MachineName() {
  std::ifstream info("/proc/cpuinfo");
  std::string name = "unknown processor";
  for (std::string line; std::getline(info, line);) {
    if (line.starts_with("model name")) {
      name = line.substr(line.find(':') + 2);
      break;
    }
  }
  return fmt::format("{}, {} threads", name, std::thread::hardware_concurrency());
}

}  // namespace sole::app
