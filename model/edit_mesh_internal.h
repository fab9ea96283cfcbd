#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

namespace sole::model {

/// A triangle mesh whose connectivity changes. Vertices and triangles keep their numbers; removed
/// ones are marked.
class EditMesh {
 public:
  EditMesh(std::span<const Eigen::Vector3d> positions, std::span<const Eigen::Vector3i> triangles);

  std::size_t NumVertices() const { return positions_.size(); }
  bool Alive(int v) const { return !around_[Index(v)].empty(); }
  bool OnBoundary(int v) const { return boundary_[Index(v)]; }
  const Eigen::Vector3d& Position(int v) const { return positions_[Index(v)]; }
  void Move(int v, const Eigen::Vector3d& position) { positions_[Index(v)] = position; }
  const std::vector<int>& TrianglesOf(int v) const { return around_[Index(v)]; }
  const Eigen::Vector3i& Triangle(int t) const { return triangles_[Index(t)]; }
  std::vector<int> Neighbours(int v) const;
  /// Triangles that hold both vertices.
  std::vector<int> TrianglesOfEdge(int u, int v) const;

  /// Whether moving u onto v keeps the surface a manifold of the same kind and does not shorten a
  /// boundary loop below 3.
  bool CollapseKeepsTopology(int u, int v) const;
  void Collapse(int u, int v);

  /// Replaces the diagonal of the two triangles of edge (u, v). False (and nothing done) for a
  /// boundary edge or where the other diagonal exists already.
  bool Flip(int u, int v);

  /// Unit normal of triangle t with vertex `moved` at `position` (moved < 0: as it is).
  Eigen::Vector3d Normal(int t, int moved, const Eigen::Vector3d& position) const;
  /// Smallest quality (triangle_topology.h) and smallest cosine between old and new normals of the
  /// triangles around u but without those that hold `without` (< 0: none), if u goes to `position`.
  struct MoveEffect {
    double quality = 1;
    double cosine = 1;
  };
  MoveEffect EffectOfMove(int u, const Eigen::Vector3d& position, int without) const;

  std::vector<Eigen::Vector3i> LiveTriangles() const;

 private:
  static std::size_t Index(int i) { return static_cast<std::size_t>(i); }
  bool Holds(int t, int v) const { return (triangles_[Index(t)].array() == v).any(); }
  void RemoveTriangle(int t);
  /// Area-weighted unit normal around a vertex.
  Eigen::Vector3d FanNormal(int v) const;

  std::vector<Eigen::Vector3d> positions_;
  std::vector<Eigen::Vector3i> triangles_;  ///< removed ones hold -1
  std::vector<std::vector<int>> around_;
  std::vector<bool> boundary_;
};

}  // namespace sole::model
