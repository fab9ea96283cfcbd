#pragma once

#include <Eigen/Geometry>

#include "core/point_cloud.h"
#include "sim/foot.h"
#include "tests/support/meshes.h"

namespace sole::testing_support {

/// A simulated person's standing foot at a place of the plate, toes turned by `heading_rad` to the left of +y.
struct StandingFoot {
  Side side = Side::kRight;
  TriangleMesh mesh;
};
inline StandingFoot MakeStandingFoot(std::uint64_t seed, Side side, const Eigen::Vector2d& place_m, double heading_rad) {
  const sim::Subject subject = sim::DrawSubject(seed, side);
  StandingFoot foot{side, {sim::StandOnPlate(subject, 0.4 * 9.81 * subject.weight_kg).foot.vertices_m, sim::FootTriangles(side)}};
  const Eigen::Isometry3d move = Eigen::Translation3d(place_m.x(), place_m.y(), 0) *
                                 Eigen::AngleAxisd(heading_rad, Eigen::Vector3d::UnitZ());
  for (Eigen::Vector3d& v : foot.mesh.vertices) v = move * v;
  return foot;
}

/// `count` points with a scan's noise all over a foot, the sole included; nothing on the cut above the ankle.
inline PointCloud CloudOf(const StandingFoot& foot, int count, unsigned seed) {
  double top = 0;
  for (const Eigen::Vector3d& v : foot.mesh.vertices) top = std::max(top, v.z());
  const PointCloud all = SampleMesh(foot.mesh, count, 5e-5, seed);
  PointCloud cloud;
  for (std::size_t i = 0; i < all.Size(); ++i) {
    if (all.points_m[i].z() > static_cast<float>(top) - 0.001F) continue;
    cloud.points_m.push_back(all.points_m[i]);
    cloud.normals.push_back(all.normals[i]);
    cloud.sigma_m.push_back(all.sigma_m[i]);
  }
  return cloud;
}

inline void Append(const PointCloud& from, PointCloud& to) {
  to.points_m.insert(to.points_m.end(), from.points_m.begin(), from.points_m.end());
  to.normals.insert(to.normals.end(), from.normals.begin(), from.normals.end());
  to.sigma_m.insert(to.sigma_m.end(), from.sigma_m.begin(), from.sigma_m.end());
}

}  // namespace sole::testing_support
