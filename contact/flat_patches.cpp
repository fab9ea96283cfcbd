#include "contact/flat_patches.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <set>
#include <utility>

#include <Eigen/Geometry>
#include <pcl/ModelCoefficients.h>
#include <pcl/console/print.h>
#include <pcl/point_types.h>
#include <pcl/segmentation/sac_segmentation.h>

namespace sole::contact {
namespace {

using Indices = std::vector<std::size_t>;

Indices EvenlyThinned(const Indices& from, std::size_t count) {
  const std::size_t kept = std::min(count, from.size());
  Indices thinned(kept);
  for (std::size_t k = 0; k < kept; ++k) thinned[k] = from[k * from.size() / kept];
  return thinned;
}

/// The plane with most of the given points, by RANSAC, moved to fit them.
std::optional<Eigen::Hyperplane<double, 3>> LargestPlane(const PointCloud& scan, const Indices& among,
                                                         const FlatPatchOptions& options) {
  pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
  for (const std::size_t i : EvenlyThinned(among, options.points)) {
    const Eigen::Vector3f& p = scan.points_m[i];
    cloud->emplace_back(p.x(), p.y(), p.z());
  }
  if (cloud->size() < 100) return {};
  // PCL would print a line for every draw of three points in a row.
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
  pcl::SACSegmentation<pcl::PointXYZ> segmentation;
  segmentation.setModelType(pcl::SACMODEL_PLANE);
  segmentation.setMethodType(pcl::SAC_RANSAC);
  segmentation.setOptimizeCoefficients(true);
  segmentation.setMaxIterations(5000);
  segmentation.setProbability(0.999);
  segmentation.setDistanceThreshold(options.thickness_m);
  segmentation.setInputCloud(cloud);
  pcl::PointIndices inliers;
  pcl::ModelCoefficients plane;
  segmentation.segment(inliers, plane);
  if (inliers.indices.size() < 20 || plane.values.size() != 4) return {};
  Eigen::Vector3d normal(plane.values[0], plane.values[1], plane.values[2]);
  const double length = normal.norm();
  return Eigen::Hyperplane<double, 3>(normal / length, plane.values[3] / length);
}

/// Area of the convex outline of points in a plane (Andrew's monotone chain).
double HullArea(std::vector<Eigen::Vector2i> points) {
  const auto before = [](const Eigen::Vector2i& a, const Eigen::Vector2i& b) {
    return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y();
  };
  std::sort(points.begin(), points.end(), before);
  const auto turn = [](const Eigen::Vector2i& a, const Eigen::Vector2i& b, const Eigen::Vector2i& c) {
    const Eigen::Vector2i u = b - a, v = c - a;
    return u.x() * v.y() - u.y() * v.x();
  };
  double twice = 0;
  for (int half = 0; half < 2; ++half, std::reverse(points.begin(), points.end())) {
    std::vector<Eigen::Vector2i> chain;
    for (const Eigen::Vector2i& p : points) {
      while (chain.size() >= 2 && turn(chain[chain.size() - 2], chain.back(), p) <= 0) chain.pop_back();
      chain.push_back(p);
    }
    for (std::size_t i = 1; i < chain.size(); ++i)
      twice += chain[i - 1].x() * chain[i].y() - chain[i - 1].y() * chain[i].x();
  }
  return 0.5 * twice;
}

/// Area of a patch and how much of its convex outline is filled, on a grid of cells.
void MeasurePatch(const PointCloud& scan, double cell_m, FlatPatch& patch) {
  Eigen::Vector3d u = patch.normal.unitOrthogonal();
  const Eigen::Vector3d v = patch.normal.cross(u);
  std::set<std::pair<int, int>> cells;
  for (const std::size_t i : patch.points) {
    const Eigen::Vector3d p = scan.points_m[i].cast<double>() - patch.point;
    cells.emplace(static_cast<int>(std::floor(p.dot(u) / cell_m)), static_cast<int>(std::floor(p.dot(v) / cell_m)));
  }
  std::vector<Eigen::Vector2i> corners;
  for (const auto& [x, y] : cells) {
    for (int k = 0; k < 4; ++k) corners.emplace_back(x + k % 2, y + k / 2);
  }
  patch.area_m2 = cell_m * cell_m * static_cast<double>(cells.size());
  patch.filled = static_cast<double>(cells.size()) / std::max(1.0, HullArea(corners));
}

}  // namespace

std::vector<FlatPatch> FindFlatPatches(const PointCloud& scan, const FlatPatchOptions& options) {
  Indices left(scan.Size());
  std::iota(left.begin(), left.end(), std::size_t{0});
  std::vector<FlatPatch> patches;
  for (int k = 0; k < options.planes; ++k) {
    const auto plane = LargestPlane(scan, left, options);
    if (!plane) break;
    FlatPatch patch;
    patch.normal = plane->normal();
    patch.point = -plane->offset() * plane->normal();
    std::size_t above = 0, below = 0;
    for (const Eigen::Vector3f& p : scan.points_m) {
      const double height = plane->signedDistance(p.cast<double>());
      above += height > options.thickness_m;
      below += height < -options.thickness_m;
    }
    if (below > above) patch.normal = -patch.normal;
    Indices others;
    for (const std::size_t i : left) {
      const bool near = plane->absDistance(scan.points_m[i].cast<double>()) <= options.thickness_m;
      const bool along = scan.normals.empty() ||
                         scan.normals[i].cast<double>().dot(patch.normal) < -options.min_normal_cosine;
      // A floor seen around the foot is seen from above: its normals may point either way.
      const bool against = !scan.normals.empty() &&
                           scan.normals[i].cast<double>().dot(patch.normal) > options.min_normal_cosine;
      (near && (along || against) ? patch.points : others).push_back(i);
    }
    // Points that are near the plane by chance must not be found again.
    std::erase_if(others, [&](std::size_t i) {
      return plane->absDistance(scan.points_m[i].cast<double>()) <= options.thickness_m;
    });
    left = std::move(others);
    if (patch.points.empty()) continue;
    MeasurePatch(scan, options.cell_m, patch);
    if (static_cast<double>(std::min(above, below)) > options.max_beyond * static_cast<double>(scan.Size())) continue;
    if (patch.area_m2 >= options.min_area_m2) patches.push_back(std::move(patch));
  }
  std::stable_sort(patches.begin(), patches.end(),
                   [](const FlatPatch& a, const FlatPatch& b) { return a.area_m2 > b.area_m2; });
  return patches;
}

}  // namespace sole::contact
