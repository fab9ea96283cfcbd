#include "model/surface_topology.h"

#include <algorithm>

#include "model/mesh_topology.h"

namespace sole::model {

SurfaceTopology TopologyOf(const TriangleMesh& mesh) {
  SurfaceTopology topology{Edges(mesh), {}, BoundaryVertices(mesh)};
  topology.triangle_edges.reserve(mesh.triangles.size());
  for (const Eigen::Vector3i& t : mesh.triangles) {
    Eigen::Vector3i edges;
    for (int k = 0; k < 3; ++k) {
      const std::pair<int, int> edge = std::minmax({t[k], t[(k + 1) % 3]});
      edges[k] = static_cast<int>(
          std::lower_bound(topology.edges.begin(), topology.edges.end(), edge) - topology.edges.begin());
    }
    topology.triangle_edges.push_back(edges);
  }
  return topology;
}

}  // namespace sole::model
