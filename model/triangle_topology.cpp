#include "model/triangle_topology.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>
#include <set>
#include <utility>

#include "core/error.h"

namespace sole::model {
namespace {

std::size_t At(int index) { return static_cast<std::size_t>(index); }

/// Directed edges -> how many triangles run along them.
std::map<std::pair<int, int>, int> DirectedEdges(std::span<const Eigen::Vector3i> triangles) {
  std::map<std::pair<int, int>, int> edges;
  for (const Eigen::Vector3i& t : triangles) {
    for (int corner = 0; corner < 3; ++corner) ++edges[{t[corner], t[(corner + 1) % 3]}];
  }
  return edges;
}

}  // namespace

std::vector<std::vector<int>> TrianglesOfVertices(std::size_t num_vertices,
                                                  std::span<const Eigen::Vector3i> triangles) {
  std::vector<std::vector<int>> around(num_vertices);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (int corner = 0; corner < 3; ++corner)
      around.at(At(triangles[t][corner])).push_back(static_cast<int>(t));
  }
  return around;
}

std::vector<std::vector<int>> NeighboursOfVertices(std::size_t num_vertices,
                                                   std::span<const Eigen::Vector3i> triangles) {
  std::vector<std::vector<int>> neighbours(num_vertices);
  for (const Eigen::Vector3i& t : triangles) {
    for (int corner = 0; corner < 3; ++corner) {
      neighbours.at(At(t[corner])).push_back(t[(corner + 1) % 3]);
      neighbours.at(At(t[corner])).push_back(t[(corner + 2) % 3]);
    }
  }
  for (std::vector<int>& list : neighbours) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return neighbours;
}

std::vector<std::vector<int>> BoundaryLoops(std::span<const Eigen::Vector3i> triangles) {
  const std::map<std::pair<int, int>, int> edges = DirectedEdges(triangles);
  std::map<int, int> next;
  for (const auto& [edge, count] : edges) {
    if (edges.contains({edge.second, edge.first})) continue;
    Require(next.emplace(edge.first, edge.second).second,
            "mesh: two boundary loops touch in a vertex");
  }
  std::vector<std::vector<int>> loops;
  while (!next.empty()) {
    std::vector<int> loop;
    for (auto it = next.begin(); it != next.end(); it = next.find(loop.back())) {
      if (loop.empty()) loop.push_back(it->first);
      const int following = it->second;
      next.erase(it);
      if (following == loop.front()) break;
      loop.push_back(following);
    }
    loops.push_back(loop);
  }
  return loops;
}

bool IsOrientedManifold(std::size_t num_vertices, std::span<const Eigen::Vector3i> triangles) {
  const std::map<std::pair<int, int>, int> edges = DirectedEdges(triangles);
  for (const auto& [edge, count] : edges) {
    if (count != 1 || edge.first == edge.second) return false;
  }
  const std::vector<std::vector<int>> around = TrianglesOfVertices(num_vertices, triangles);
  for (std::size_t v = 0; v < num_vertices; ++v) {
    if (around[v].empty()) continue;
    // Walk the fan: following[a] = b for the edge opposite v.
    std::map<int, int> following;
    std::set<int> ends;
    for (const int t : around[v]) {
      const Eigen::Vector3i& triangle = triangles[At(t)];
      const int corner =
          triangle[0] == static_cast<int>(v) ? 0 : (triangle[1] == static_cast<int>(v) ? 1 : 2);
      following[triangle[(corner + 1) % 3]] = triangle[(corner + 2) % 3];
      ends.insert(triangle[(corner + 2) % 3]);
    }
    int start = following.begin()->first;
    for (const auto& [from, to] : following) {
      if (!ends.contains(from)) start = from;
    }
    std::size_t steps = 0;
    for (auto it = following.find(start); it != following.end() && steps < following.size();
         it = following.find(it->second))
      ++steps;
    if (steps != around[v].size()) return false;
  }
  return true;
}

int EulerCharacteristic(std::span<const Eigen::Vector3i> triangles) {
  std::set<int> vertices;
  std::set<std::pair<int, int>> edges;
  for (const Eigen::Vector3i& t : triangles) {
    for (int corner = 0; corner < 3; ++corner) {
      vertices.insert(t[corner]);
      edges.insert(std::minmax(t[corner], t[(corner + 1) % 3]));
    }
  }
  return static_cast<int>(vertices.size()) - static_cast<int>(edges.size()) +
         static_cast<int>(triangles.size());
}

double TriangleQuality(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                       const Eigen::Vector3d& c) {
  const double squares = (b - a).squaredNorm() + (c - b).squaredNorm() + (a - c).squaredNorm();
  return squares > 0 ? 2 * std::sqrt(3.0) * (b - a).cross(c - a).norm() / squares : 0;
}

std::vector<double> VertexAreas(const TriangleMesh& mesh) {
  std::vector<double> areas(mesh.vertices.size(), 0.0);
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const Eigen::Vector3d& a = mesh.vertices[At(t[0])];
    const double area =
        0.5 * (mesh.vertices[At(t[1])] - a).cross(mesh.vertices[At(t[2])] - a).norm();
    for (int corner = 0; corner < 3; ++corner) areas[At(t[corner])] += area / 3;
  }
  return areas;
}

}  // namespace sole::model
