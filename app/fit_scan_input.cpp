#include "app/fit_scan_input.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "core/error.h"

namespace sole::app {
namespace {

/// Distance from the middle that nearly all points keep: half a foot with its leg, or less.
constexpr double kSmallest_m = 0.06, kLargest_m = 0.6;
constexpr std::size_t kFewest = 1000;

double Radius(const std::vector<Eigen::Vector3d>& points, const Eigen::Vector3d& middle) {
  std::vector<double> distances;
  for (const Eigen::Vector3d& p : points) distances.push_back((p - middle).norm());
  const auto at = distances.begin() + static_cast<std::ptrdiff_t>(0.98 * static_cast<double>(distances.size() - 1));
  std::nth_element(distances.begin(), at, distances.end());
  return *at;
}

Eigen::Vector3d MiddleOf(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d middle;
  std::vector<double> values(points.size());
  for (int k = 0; k < 3; ++k) {
    std::transform(points.begin(), points.end(), values.begin(), [k](const Eigen::Vector3d& p) { return p[k]; });
    const auto at = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), at, values.end());
    middle[k] = *at;
  }
  return middle;
}

double UnitOf(const std::string& name, double radius) {
  for (const double unit_m : {0.001, 1.0}) {
    if (radius * unit_m >= kSmallest_m && radius * unit_m <= kLargest_m) return unit_m;
  }
  throw Error(fmt::format("{}: is {:.3g} units large, which is no foot in millimetres or metres: give --units mm or "
                          "--units m, or scale the file",
                          name, 2 * radius));
}

struct Samples {
  std::vector<Eigen::Vector3d> points, normals;
};

/// Points drawn evenly over the triangles.
Samples DrawOver(const TriangleMesh& mesh, std::size_t count) {
  std::vector<double> cumulative;
  double total = 0;
  const auto corner = [&](const Eigen::Vector3i& t, int k) { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const double area = (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).norm();
    if (std::isfinite(area)) total += area;
    cumulative.push_back(total);
  }
  Samples samples;
  if (!(total > 0) || !std::isfinite(total)) return samples;
  const std::vector<Eigen::Vector3d> normals = VertexNormals(mesh);
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> unit(0, 1);
  for (std::size_t i = 0; i < count; ++i) {
    // One point in each equal share of the area: even, and the same for the same file.
    const double at = (static_cast<double>(i) + unit(random)) / static_cast<double>(count) * total;
    const auto found = std::upper_bound(cumulative.begin(), cumulative.end(), at);
    const Eigen::Vector3i& t =
        mesh.triangles[static_cast<std::size_t>(std::min(found, cumulative.end() - 1) - cumulative.begin())];
    const double root = std::sqrt(unit(random)), other = unit(random);
    const Eigen::Vector3d shares(1 - root, root * (1 - other), root * other);
    Eigen::Vector3d point = Eigen::Vector3d::Zero(), normal = Eigen::Vector3d::Zero();
    const Eigen::Vector3d face = (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0)).normalized();
    for (int k = 0; k < 3; ++k) {
      point += shares[k] * corner(t, k);
      normal += shares[k] * normals[static_cast<std::size_t>(t[k])];
    }
    // Across a sharp edge, such as a filled sole's, the triangle's own normal is right.
    normal.normalize();
    if (!(normal.dot(face) > 0.9)) normal = face;
    if (!point.allFinite() || !normal.allFinite()) continue;
    samples.points.push_back(point);
    samples.normals.push_back(normal);
  }
  return samples;
}

Samples TakeEvenly(const io::ScanFile& file, std::size_t count) {
  std::vector<std::size_t> good;
  for (std::size_t i = 0; i < file.mesh.vertices.size(); ++i) {
    if (!file.mesh.vertices[i].allFinite()) continue;
    if (file.normals.empty() || (file.normals[i].allFinite() && file.normals[i].norm() > 0)) good.push_back(i);
  }
  Samples samples;
  const std::size_t kept = std::min(count, good.size());
  for (std::size_t k = 0; k < kept; ++k) {
    const std::size_t i = good[k * good.size() / kept];
    samples.points.push_back(file.mesh.vertices[i]);
    if (!file.normals.empty()) samples.normals.push_back(file.normals[i].normalized());
  }
  return samples;
}

}  // namespace

ScanPoints PointsOfScan(const io::ScanFile& file, const std::string& name, std::optional<double> unit_m,
                        std::size_t count) {
  ScanPoints result;
  std::size_t finite = 0;
  for (const Eigen::Vector3d& v : file.mesh.vertices) finite += v.allFinite();
  result.left_out = file.mesh.vertices.size() - finite;
  const bool surface = !file.mesh.triangles.empty();
  Samples samples = surface ? DrawOver(file.mesh, count) : TakeEvenly(file, count);
  Require(samples.points.size() >= kFewest,
          fmt::format("{}: has {} usable points ({} vertices, {} of them not numbers): a foot needs {} at least", name,
                      samples.points.size(), file.mesh.vertices.size(), result.left_out, kFewest));
  Eigen::Vector3d middle = MiddleOf(samples.points);
  const double radius = Radius(samples.points, middle);
  result.unit_m = unit_m ? *unit_m : UnitOf(name, radius);
  const double radius_m = radius * result.unit_m;
  Require(radius_m >= kSmallest_m && radius_m <= kLargest_m,
          fmt::format("{}: is {:.0f} mm large, which is no foot: check --units", name, 2e3 * radius_m));
  result.middle_m = result.unit_m * middle;
  // Faces of a body look away from its middle, on the whole.
  double outwards = 0;
  for (std::size_t i = 0; i < samples.normals.size(); ++i)
    outwards += samples.normals[i].dot((samples.points[i] - middle).normalized());
  const double sign = outwards < 0 ? -1 : 1;
  for (std::size_t i = 0; i < samples.points.size(); ++i) {
    result.cloud.points_m.push_back((result.unit_m * samples.points[i] - result.middle_m).cast<float>());
    if (!samples.normals.empty()) result.cloud.normals.push_back((sign * samples.normals[i]).cast<float>());
  }
  return result;
}

}  // namespace sole::app
