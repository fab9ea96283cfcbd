#include <Eigen/Geometry>
#include <algorithm>
#include <iterator>

#include "model/edit_mesh_internal.h"
#include "model/triangle_topology.h"

namespace sole::model {

EditMesh::EditMesh(std::span<const Eigen::Vector3d> positions,
                   std::span<const Eigen::Vector3i> triangles)
    : positions_(positions.begin(), positions.end()),
      triangles_(triangles.begin(), triangles.end()),
      around_(TrianglesOfVertices(positions.size(), triangles)),
      boundary_(positions.size(), false) {
  for (const std::vector<int>& loop : BoundaryLoops(triangles)) {
    for (const int v : loop) boundary_[Index(v)] = true;
  }
}

std::vector<int> EditMesh::Neighbours(int v) const {
  std::vector<int> neighbours;
  for (const int t : around_[Index(v)]) {
    for (const int other : triangles_[Index(t)]) {
      if (other != v) neighbours.push_back(other);
    }
  }
  std::sort(neighbours.begin(), neighbours.end());
  neighbours.erase(std::unique(neighbours.begin(), neighbours.end()), neighbours.end());
  return neighbours;
}

std::vector<int> EditMesh::TrianglesOfEdge(int u, int v) const {
  std::vector<int> shared;
  for (const int t : around_[Index(u)]) {
    if (Holds(t, v)) shared.push_back(t);
  }
  return shared;
}

bool EditMesh::CollapseKeepsTopology(int u, int v) const {
  const std::size_t shared = TrianglesOfEdge(u, v).size();
  const bool boundary_edge = shared == 1;
  if (OnBoundary(u) && !boundary_edge) return false;
  std::vector<int> common;
  const std::vector<int> of_u = Neighbours(u), of_v = Neighbours(v);
  std::set_intersection(of_u.begin(), of_u.end(), of_v.begin(), of_v.end(),
                        std::back_inserter(common));
  if (common.size() != shared) return false;
  for (const int w : common) {
    // The third vertex must keep three triangles (two on the boundary).
    const std::size_t left = around_[Index(w)].size() - 1;
    if (left < (OnBoundary(w) ? 1U : 3U)) return false;
  }
  return true;
}

void EditMesh::RemoveTriangle(int t) {
  for (const int v : triangles_[Index(t)]) std::erase(around_[Index(v)], t);
  triangles_[Index(t)].setConstant(-1);
}

void EditMesh::Collapse(int u, int v) {
  for (const int t : TrianglesOfEdge(u, v)) RemoveTriangle(t);
  for (const int t : around_[Index(u)]) {
    for (int& corner : triangles_[Index(t)]) {
      if (corner == u) corner = v;
    }
    around_[Index(v)].push_back(t);
  }
  around_[Index(u)].clear();
}

bool EditMesh::Flip(int u, int v) {
  const std::vector<int> shared = TrianglesOfEdge(u, v);
  if (shared.size() != 2) return false;
  // First triangle runs u -> v -> a, the second v -> u -> b.
  int first = shared[0], second = shared[1];
  const auto third = [&](int t) {
    for (const int w : triangles_[Index(t)]) {
      if (w != u && w != v) return w;
    }
    return -1;
  };
  const auto runs = [&](int t) {
    const Eigen::Vector3i& c = triangles_[Index(t)];
    return (c[0] == u && c[1] == v) || (c[1] == u && c[2] == v) || (c[2] == u && c[0] == v);
  };
  if (!runs(first)) std::swap(first, second);
  const int a = third(first), b = third(second);
  if (a == b || !TrianglesOfEdge(a, b).empty()) return false;
  if (around_[Index(u)].size() <= (OnBoundary(u) ? 1U : 3U) ||
      around_[Index(v)].size() <= (OnBoundary(v) ? 1U : 3U))
    return false;
  triangles_[Index(first)] = Eigen::Vector3i(a, b, v);
  triangles_[Index(second)] = Eigen::Vector3i(b, a, u);
  std::erase(around_[Index(u)], first);
  std::erase(around_[Index(v)], second);
  around_[Index(a)].push_back(second);
  around_[Index(b)].push_back(first);
  return true;
}

Eigen::Vector3d EditMesh::Normal(int t, int moved, const Eigen::Vector3d& position) const {
  const Eigen::Vector3i& c = triangles_[Index(t)];
  const auto at = [&](int corner) {
    return c[corner] == moved ? position : positions_[Index(c[corner])];
  };
  const Eigen::Vector3d a = at(0), b = at(1), d = at(2);
  return (b - a).cross(d - a).stableNormalized();
}

Eigen::Vector3d EditMesh::FanNormal(int v) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const int t : around_[Index(v)]) {
    const Eigen::Vector3i& c = triangles_[Index(t)];
    const Eigen::Vector3d& a = positions_[Index(c[0])];
    sum += (positions_[Index(c[1])] - a).cross(positions_[Index(c[2])] - a);
  }
  return sum.stableNormalized();
}

EditMesh::MoveEffect EditMesh::EffectOfMove(int u, const Eigen::Vector3d& position,
                                            int without) const {
  MoveEffect effect;
  const Eigen::Vector3d fan = FanNormal(u);
  for (const int t : around_[Index(u)]) {
    if (without >= 0 && Holds(t, without)) continue;
    const Eigen::Vector3i& c = triangles_[Index(t)];
    const auto at = [&](int corner) {
      return c[corner] == u ? position : positions_[Index(c[corner])];
    };
    effect.quality = std::min(effect.quality, TriangleQuality(at(0), at(1), at(2)));
    // A sliver's own normal says little.
    const bool sliver = TriangleQuality(positions_[Index(c[0])], positions_[Index(c[1])],
                                        positions_[Index(c[2])]) < 0.1;
    const Eigen::Vector3d before = sliver ? fan : Normal(t, -1, position);
    effect.cosine = std::min(effect.cosine, before.dot(Normal(t, u, position)));
  }
  return effect;
}

std::vector<Eigen::Vector3i> EditMesh::LiveTriangles() const {
  std::vector<Eigen::Vector3i> live;
  for (const Eigen::Vector3i& t : triangles_) {
    if (t[0] >= 0) live.push_back(t);
  }
  return live;
}

}  // namespace sole::model
