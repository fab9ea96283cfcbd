#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>

#include "core/point_cloud.h"

namespace sole::contact {

/// A flat patch with the whole scan on one side of it: a sole or a cut leg that a scanner's program filled, the floor
/// that the foot stands on, or skin that is pressed flat on it.
struct FlatPatch {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();  ///< unit, towards the scan
  std::vector<std::size_t> points;                    ///< of the scan that lie in it
  double area_m2 = 0;
  double filled = 0;  ///< share of its convex outline that has points
};

struct FlatPatchOptions {
  double thickness_m = 0.0005;   ///< points nearer to a plane lie in it
  double min_area_m2 = 0.0015;
  double max_beyond = 0.01;      ///< share of the scan's points that may lie on the far side
  double min_normal_cosine = 0.9;
  double cell_m = 0.004;         ///< of the grid that area and filling are counted in
  std::size_t points = 5000;     ///< that RANSAC looks at, evenly thinned
  int planes = 5;                ///< that are tried at most, the largest first
};

/// Largest first. Normals of the scan, where it has them, must agree with a patch's plane.
std::vector<FlatPatch> FindFlatPatches(const PointCloud& scan, const FlatPatchOptions& options = {});

}  // namespace sole::contact
