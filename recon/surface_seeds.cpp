#include "recon/surface_seeds.h"

#include <cmath>
#include <cstddef>
#include <map>
#include <optional>
#include <utility>

#include "core/error.h"

namespace sole::recon {
namespace {

constexpr double kMinCosine = 0.25;  // steeper points are seen too badly to begin at

/// A point of the surface in front of a left pixel.
struct Candidate {
  std::size_t point = 0;
  double distance_m = 0;
};

bool Faces(const Camera& camera, const Eigen::Vector3d& point, const Eigen::Vector3d& normal) {
  return (camera.CentreInWorld() - point).normalized().dot(normal) > kMinCosine;
}

/// Right pixel of what the left one sees of a plane.
std::optional<Eigen::Vector2d> Through(const Rig& rig, const Camera& left, const Camera& right,
                                       const Eigen::Vector2d& left_px, const Eigen::Vector3d& point,
                                       const Eigen::Vector3d& normal) {
  const Ray ray = RayFromPixel(left, rig.plate, left_px);
  const double along = normal.dot(point - ray.origin) / normal.dot(ray.direction);
  const Eigen::Vector2d px =
      PixelFromWorld(right, rig.plate, ray.origin + along * ray.direction);
  if (!px.allFinite()) return {};
  return px;
}

}  // namespace

std::vector<PixelMatch> SeedsFromSurface(const Rig& rig, int pair, const PointCloud& surface,
                                         int step_px) {
  Require(surface.normals.size() == surface.Size(), "seeds need a surface with normals");
  Require(pair >= 0 && pair < static_cast<int>(rig.pairs.size()), "no such pair in the rig");
  Require(step_px >= 1, "seeds: step_px must be at least 1");
  const StereoPair& names = rig.pairs[static_cast<std::size_t>(pair)];
  const Camera& left = rig.cameras[static_cast<std::size_t>(names.left)];
  const Camera& right = rig.cameras[static_cast<std::size_t>(names.right)];
  std::map<std::pair<int, int>, Candidate> nearest;  // by row, column
  const Eigen::Vector3d centre = left.CentreInWorld();
  for (std::size_t i = 0; i < surface.Size(); ++i) {
    const Eigen::Vector3d point = surface.points_m[i].cast<double>();
    const Eigen::Vector3d normal = surface.normals[i].cast<double>();
    if (!Faces(left, point, normal) || !Faces(right, point, normal)) continue;
    const Eigen::Vector2d px = PixelFromWorld(left, rig.plate, point);
    if (!px.allFinite() || px.minCoeff() < 0 || px.x() > left.width - 1 ||
        px.y() > left.height - 1)
      continue;
    const double distance_m = (point - centre).norm();
    // The point serves the nodes around it, so that a surface coarser than the grid leaves no gaps.
    const int cx = static_cast<int>(px.x()) / step_px, cy = static_cast<int>(px.y()) / step_px;
    for (int y = cy; y <= cy + 1; ++y) {
      for (int x = cx; x <= cx + 1; ++x) {
        if (x * step_px >= left.width || y * step_px >= left.height) continue;
        const auto [entry, added] = nearest.try_emplace({y, x}, Candidate{i, distance_m});
        if (!added && distance_m < entry->second.distance_m) entry->second = {i, distance_m};
      }
    }
  }
  std::vector<PixelMatch> seeds;
  for (const auto& [node, candidate] : nearest) {
    const Eigen::Vector3d point = surface.points_m[candidate.point].cast<double>();
    const Eigen::Vector3d normal = surface.normals[candidate.point].cast<double>();
    PixelMatch seed;
    seed.left_px = step_px * Eigen::Vector2i(node.second, node.first);
    const Eigen::Vector2d px = seed.left_px.cast<double>();
    constexpr double kStep = 4;
    const auto at = Through(rig, left, right, px, point, normal);
    const auto by_x = Through(rig, left, right, px + Eigen::Vector2d(kStep, 0), point, normal);
    const auto by_y = Through(rig, left, right, px + Eigen::Vector2d(0, kStep), point, normal);
    if (!at || !by_x || !by_y) continue;
    seed.match.status = SubsetStatus::kMatched;
    seed.match.warp.position_px = *at;
    seed.match.warp.gradient.col(0) = (*by_x - *at) / kStep;
    seed.match.warp.gradient.col(1) = (*by_y - *at) / kStep;
    seeds.push_back(seed);
  }
  return seeds;
}

}  // namespace sole::recon
