#include "sim/scan_cloud.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>
#include <random>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>

#include "core/error.h"

namespace sole::sim {
namespace {

using Eigen::Vector3d;

/// Gaussian random field of unit variance and covariance exp(-d^2 / (2 length^2)): a sum of waves.
class SmoothField {
 public:
  SmoothField(double length_m, std::mt19937_64& random) {
    std::normal_distribution<double> wave(0, 1 / length_m);
    std::uniform_real_distribution<double> phase(0, 2 * std::numbers::pi);
    for (Eigen::Index i = 0; i < kWaves; ++i) {
      for (int axis = 0; axis < 3; ++axis) waves_(i, axis) = static_cast<float>(wave(random));
      phases_[i] = static_cast<float>(phase(random));
    }
  }
  /// In float: a thousandth of its deviation is plenty for noise.
  double At(const Vector3d& point) const {
    const Eigen::Array<float, kWaves, 1> turns = (waves_ * point.cast<float>()).array() + phases_;
    return static_cast<double>(turns.cos().sum()) * std::sqrt(2.0 / kWaves);
  }

 private:
  static constexpr Eigen::Index kWaves = 64;
  Eigen::Matrix<float, kWaves, 3> waves_;
  Eigen::Array<float, kWaves, 1> phases_;
};

/// Correlated errors of unit variance.
class ErrorField {
 public:
  ErrorField(const std::vector<NoiseComponent>& components, std::mt19937_64& random) {
    for (const NoiseComponent& c : components) {
      if (c.share <= 0) continue;
      if (c.length_m > 0) {
        fields_.emplace_back(std::sqrt(c.share), SmoothField(c.length_m, random));
      } else {
        white_ += c.share;
      }
    }
    white_ = std::sqrt(white_);
  }
  double At(const Vector3d& point, double white) const {
    double sum = white_ * white;
    for (const auto& [amplitude, field] : fields_) sum += amplitude * field.At(point);
    return sum;
  }

 private:
  double white_ = 0;
  std::vector<std::pair<double, SmoothField>> fields_;
};

/// Probability that a standard normal number is below x.
double NormalShare(double x) { return 0.5 * std::erfc(-x / std::numbers::sqrt2); }

std::uint64_t CellOf(const Vector3d& p, double voxel_m) {
  constexpr std::int64_t kOffset = 1 << 20;
  std::uint64_t cell = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const auto index = static_cast<std::int64_t>(std::floor(p[axis] / voxel_m)) + kOffset;
    cell = (cell << 21) | (static_cast<std::uint64_t>(index) & 0x1FFFFF);
  }
  return cell;
}

/// The places in one cell, and the one of them that is nearest to their mean.
struct Cell {
  Vector3d sum = Vector3d::Zero();
  int count = 0;
  double nearest2 = std::numeric_limits<double>::infinity();
  std::size_t place = 0;
};

/// `count` of them at random, in their order.
std::vector<ScanPoint> Thinned(const std::vector<ScanPoint>& places, std::size_t count,
                               std::uint64_t seed) {
  std::vector<ScanPoint> kept;
  std::mt19937_64 random(seed);
  std::sample(places.begin(), places.end(), std::back_inserter(kept), count, random);
  return kept;
}

}  // namespace

ScanView ViewAt(const TriangleMesh& mesh, std::span<const ScanView> views, const SurfacePoint& at) {
  const Eigen::Vector3i& t = mesh.triangles[static_cast<std::size_t>(at.triangle)];
  Eigen::Index nearest = 0;
  at.barycentric.maxCoeff(&nearest);
  ScanView mixed = views[static_cast<std::size_t>(t[nearest])];
  mixed.incidence_rad = mixed.edge_m = 0;
  for (int k = 0; k < 3; ++k) {
    const ScanView& corner = views[static_cast<std::size_t>(t[k])];
    if (corner.pairs == 0) return {};
    mixed.incidence_rad += static_cast<float>(at.barycentric[k]) * corner.incidence_rad;
    mixed.edge_m += static_cast<float>(at.barycentric[k]) * corner.edge_m;
  }
  return mixed;
}

std::vector<ScanPoint> SampleSeenSurface(const TriangleMesh& mesh, std::span<const ScanView> views,
                                         double voxel_m, std::uint64_t seed) {
  Require(views.size() == mesh.vertices.size(), "scan: one view per vertex");
  Require(voxel_m > 0, "scan: the voxel size must be positive");
  constexpr double kPlacesPerVoxel = 4;  // on a face of it
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit;
  std::vector<ScanPoint> places;
  std::vector<Vector3d> points;
  double owed = unit(random);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const Eigen::Vector3i& t = mesh.triangles[i];
    const auto corner = [&](int k) { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
    const SurfacePoint middle{static_cast<int>(i), Vector3d::Constant(1.0 / 3)};
    if (ViewAt(mesh, views, middle).pairs == 0) continue;
    owed += kPlacesPerVoxel * 0.5 * (corner(1) - corner(0)).cross(corner(2) - corner(0)).norm() /
            (voxel_m * voxel_m);
    for (; owed >= 1; owed -= 1) {
      const double root = std::sqrt(unit(random)), along = unit(random);
      const SurfacePoint at{static_cast<int>(i), {1 - root, root * (1 - along), root * along}};
      places.push_back({at, ViewAt(mesh, views, at)});
      points.push_back(PositionOf(mesh, at));
    }
  }
  std::unordered_map<std::uint64_t, Cell> cells;
  cells.reserve(places.size() / 2);
  for (const Vector3d& p : points) {
    Cell& cell = cells[CellOf(p, voxel_m)];
    cell.sum += p;
    ++cell.count;
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    Cell& cell = cells[CellOf(points[i], voxel_m)];
    const double off2 = (points[i] - cell.sum / cell.count).squaredNorm();
    if (off2 >= cell.nearest2) continue;
    cell.nearest2 = off2;
    cell.place = i;
  }
  std::vector<ScanPoint> result;
  result.reserve(cells.size());
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (cells[CellOf(points[i], voxel_m)].place == i) result.push_back(places[i]);
  }
  return result;
}

PointCloud MakeScanCloud(const TriangleMesh& mesh, std::span<const ScanView> views,
                         const ScanNoise& noise, const ScanCloudOptions& options) {
  std::mt19937_64 random(options.seed), sequence(options.sequence_seed);
  std::vector<ScanPoint> places = SampleSeenSurface(mesh, views, noise.voxel_m, random());
  if (options.max_points > 0) places = Thinned(places, options.max_points, random());
  const std::vector<Vector3d> normals = VertexNormals(mesh);
  const SmoothField holes(noise.hole_length_m, random);
  const ErrorField glass(noise.glass.components, random), air(noise.air.components, random);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit;
  std::array<double, 256> pair_offset{};
  for (double& offset : pair_offset) offset = normal(sequence);

  PointCloud cloud;
  for (const ScanPoint& place : places) {
    const ScanView& view = place.view;
    const SideNoise& side = noise.Side(view);
    const std::size_t incidence = IncidenceBin(view), edge = EdgeBin(view);
    // Drawn for every place, so that a gap does not change what comes after it.
    const double white = normal(random), tilt_a = normal(random), tilt_b = normal(random),
                 fate = unit(random), far = unit(random);
    Vector3d n = Vector3d::Zero();
    const Eigen::Vector3i& t = mesh.triangles[static_cast<std::size_t>(place.at.triangle)];
    for (int k = 0; k < 3; ++k)
      n += place.at.barycentric[k] * normals[static_cast<std::size_t>(t[k])];
    n.normalize();
    Vector3d point = PositionOf(mesh, place.at);
    const double share = side.completeness[incidence][edge];
    if (share < 1 && NormalShare(holes.At(point)) > share) continue;
    double error = side.mean_m[incidence] +
                   side.pair_bias_m * pair_offset[static_cast<std::size_t>(view.pair) % 256] +
                   noise.Sd(view) * (view.through_glass ? glass : air).At(point, white);
    if (fate < side.outlier_share[edge])
      error = (far < 0.5 ? 1 : -1) * -side.outlier_m * std::log(1 - std::abs(2 * far - 1) + 1e-9);
    point += error * n;
    const Vector3d across = n.unitOrthogonal();
    const Vector3d tilted =
        (n + side.normal_rad[incidence] * (tilt_a * across + tilt_b * n.cross(across)))
            .normalized();
    cloud.points_m.push_back(point.cast<float>());
    cloud.normals.push_back(tilted.cast<float>());
    cloud.sigma_m.push_back(static_cast<float>(side.stated_sigma_m[incidence]));
    cloud.pair.push_back(static_cast<std::uint8_t>(view.pair));
  }
  return cloud;
}

}  // namespace sole::sim
