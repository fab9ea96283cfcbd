#pragma once

#include <functional>

#include "sim/reference/marching.h"
#include "sim/skin_projection.h"

namespace sole::sim {

/// What a mesh is made to follow.
struct RemeshTarget {
  std::function<double(const Eigen::Vector3d&)> edge_m;  ///< wanted edge length at a point
  /// Nearest point of the skin, of the rim or of the cap's plane.
  std::function<Eigen::Vector3d(const Eigen::Vector3d&, SkinKind)> project;
};

/// Isotropic remeshing (split, collapse, flip, smooth and project) that keeps topology, the labels and the rim between them.
LabelledMesh Remesh(const LabelledMesh& mesh, const RemeshTarget& target, int iterations);

}  // namespace sole::sim
