#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>

#include "core/mesh.h"

namespace sole::model {

/// What stays of a mesh while its vertices move; made once for all frames.
struct SurfaceTopology {
  std::vector<std::pair<int, int>> edges;       ///< each once, lower index first, sorted
  std::vector<Eigen::Vector3i> triangle_edges;  ///< per triangle the edges of its corners 0-1, 1-2 and 2-0
  std::vector<bool> boundary;                   ///< per vertex: on an open rim
};

SurfaceTopology TopologyOf(const TriangleMesh& mesh);

}  // namespace sole::model
