#include "bench/accuracy/recon_score.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "model/surface_query.h"
#include "model/triangle_topology.h"
#include "recon/rectify.h"

namespace sole::bench {
namespace {

constexpr double kInlier_m = 0.001;

using Cell = std::array<int, 3>;

Cell CellOf(const Eigen::Vector3d& p) {
  const auto at = [&](int axis) { return static_cast<int>(std::floor(p[axis] / kInlier_m)); };
  return {at(0), at(1), at(2)};
}

/// Whether a point of the cloud lies within a millimetre.
bool Covered(const std::map<Cell, std::vector<Eigen::Vector3d>>& cells, const Eigen::Vector3d& p) {
  const Cell centre = CellOf(p);
  for (int code = 0; code < 27; ++code) {
    const auto cell = cells.find({centre[0] + code % 3 - 1, centre[1] + code / 3 % 3 - 1,
                                  centre[2] + code / 9 - 1});
    if (cell == cells.end()) continue;
    for (const Eigen::Vector3d& q : cell->second) {
      if ((p - q).squaredNorm() < kInlier_m * kInlier_m) return true;
    }
  }
  return false;
}

bool InVolume(const Eigen::Vector3d& p) {
  const recon::CaptureVolume volume;
  return (p.array() >= volume.min_m.array()).all() && (p.array() <= volume.max_m.array()).all();
}

double Rms(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v;
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

double Mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() +
                  static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace

std::vector<double> SignedDistances(const TriangleMesh& mesh, const PointCloud& cloud) {
  const model::SurfaceQuery query(mesh);
  const std::vector<Eigen::Vector3d> normals = VertexNormals(mesh);
  std::vector<double> distances(cloud.Size(), std::numeric_limits<double>::infinity());
  tbb::parallel_for(std::size_t{0}, cloud.Size(), [&](std::size_t i) {
    const Eigen::Vector3d p = cloud.points_m[i].cast<double>();
    const auto hit = query.Closest(p, 0.01);
    if (!hit) return;
    const Eigen::Vector3i& t = mesh.triangles[static_cast<std::size_t>(hit->point.triangle)];
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      normal += hit->point.barycentric[k] * normals[static_cast<std::size_t>(t[k])];
    distances[i] = std::copysign(hit->distance_m, (p - hit->position).dot(normal));
  });
  return distances;
}

void ReconScore::Add(const RefSurface& truth, const PointCloud& cloud) {
  ++frames_;
  points_ += cloud.Size();
  const std::vector<double> distances = SignedDistances(truth.mesh, cloud);
  std::map<Cell, std::vector<Eigen::Vector3d>> cells;
  for (std::size_t i = 0; i < cloud.Size(); ++i) {
    const Eigen::Vector3d p = cloud.points_m[i].cast<double>();
    cells[CellOf(p)].push_back(p);
    if (!(std::abs(distances[i]) <= kInlier_m)) {
      ++outliers_;
      continue;
    }
    signed_m_.push_back(distances[i]);
    const auto sigma = static_cast<double>(cloud.sigma_m[i]);
    sigma_m_.push_back(sigma);
    within_ += std::abs(distances[i]) < sigma ? 1 : 0;
    if (through_glass_.at(cloud.pair[i])) glass_m_.push_back(distances[i]);
  }
  const std::vector<double> areas = model::VertexAreas(truth.mesh);
  for (std::size_t v = 0; v < areas.size(); ++v) {
    if (std::ranges::none_of(truth.visible, [v](const auto& pair) { return pair[v] != 0; }))
      continue;
    const bool covered = Covered(cells, truth.mesh.vertices[v]);
    seen_area_ += areas[v];
    if (covered) covered_area_ += areas[v];
    if (!InVolume(truth.mesh.vertices[v])) continue;
    seen_inside_ += areas[v];
    if (covered) covered_inside_ += areas[v];
  }
}

ReconScore::Figures ReconScore::Result() const {
  Figures f;
  if (frames_ == 0) return f;
  f.points = static_cast<double>(points_) / frames_;
  f.rms_m = Rms(signed_m_);
  f.bias_m = Mean(signed_m_);
  std::vector<double> sizes;
  for (const double d : signed_m_) sizes.push_back(std::abs(d));
  f.p95_m = Quantile(std::move(sizes), 0.95);
  f.glass_rms_m = Rms(glass_m_);
  f.glass_bias_m = Mean(glass_m_);
  f.completeness = seen_area_ > 0 ? covered_area_ / seen_area_ : 0;
  f.inside = seen_inside_ > 0 ? covered_inside_ / seen_inside_ : 0;
  if (points_ > 0) f.outliers = static_cast<double>(outliers_) / static_cast<double>(points_);
  if (!signed_m_.empty())
    f.within_sigma = static_cast<double>(within_) / static_cast<double>(signed_m_.size());
  f.median_sigma_m = Quantile(sigma_m_, 0.5);
  return f;
}

}  // namespace sole::bench
