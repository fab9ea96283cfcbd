#include "model/mesh_topology.h"

#include <algorithm>

namespace sole::model {
namespace {

/// Edges with one entry for each triangle they belong to, sorted.
std::vector<std::pair<int, int>> EdgesOfTriangles(const TriangleMesh& mesh) {
  std::vector<std::pair<int, int>> edges;
  edges.reserve(3 * mesh.triangles.size());
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) edges.push_back(std::minmax(t[k], t[(k + 1) % 3]));
  }
  std::sort(edges.begin(), edges.end());
  return edges;
}

}  // namespace

std::vector<std::pair<int, int>> Edges(const TriangleMesh& mesh) {
  std::vector<std::pair<int, int>> edges = EdgesOfTriangles(mesh);
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  return edges;
}

std::vector<bool> BoundaryVertices(const TriangleMesh& mesh) {
  const std::vector<std::pair<int, int>> edges = EdgesOfTriangles(mesh);
  std::vector<bool> boundary(mesh.vertices.size(), false);
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t end = i;
    while (end < edges.size() && edges[end] == edges[i]) ++end;
    if (end - i == 1) {
      boundary[static_cast<std::size_t>(edges[i].first)] = true;
      boundary[static_cast<std::size_t>(edges[i].second)] = true;
    }
    i = end;
  }
  return boundary;
}

}  // namespace sole::model
