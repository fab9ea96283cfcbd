#pragma once

#include <functional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace sole::sim {

/// A closed surface whose triangles are skin (0) or the flat cap (1).
struct LabelledMesh {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Eigen::Vector3i> triangles;
  std::vector<int> labels;
};

/// Marching tetrahedra of the zero set of `field` over [low, high] in cubes of `cell`, closed by a cap where the solid
/// meets the box's top plane. Manifold. `field` must be positive on the other sides of the box.
LabelledMesh MarchTetrahedra(const std::function<double(const Eigen::Vector3d&)>& field,
                             const Eigen::Vector3d& low, const Eigen::Vector3d& high, double cell);

}  // namespace sole::sim
