#include "model/decimation.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <queue>
#include <tuple>

#include "core/error.h"
#include "model/edit_mesh_internal.h"
#include "model/subset_relaxation_internal.h"
#include "model/triangle_topology.h"

namespace sole::model {
namespace {

std::size_t At(int index) { return static_cast<std::size_t>(index); }

/// Edge length at each vertex so that the surface is covered by `vertices` of them.
std::vector<double> AbsoluteSizes(const TriangleMesh& mesh, std::span<const double> size,
                                  int vertices) {
  const std::vector<double> areas = VertexAreas(mesh);
  double demand = 0;
  for (std::size_t v = 0; v < areas.size(); ++v)
    demand += areas[v] / (0.5 * std::sqrt(3.0) * size[v] * size[v]);
  const double scale = std::sqrt(demand / vertices);
  std::vector<double> absolute(size.begin(), size.end());
  for (double& s : absolute) s *= scale;
  return absolute;
}

double BoundaryLength(const TriangleMesh& mesh, const std::vector<int>& loop) {
  double length = 0;
  for (std::size_t i = 0; i < loop.size(); ++i) {
    length += (mesh.vertices[At(loop[i])] - mesh.vertices[At(loop[(i + 1) % loop.size()])]).norm();
  }
  return length;
}

class Decimator {
 public:
  Decimator(const TriangleMesh& mesh, std::vector<double> sizes, const DecimationOptions& options)
      : options_(options),
        sizes_(std::move(sizes)),
        edit_(mesh.vertices, mesh.triangles),
        quadrics_(mesh.vertices.size(), Eigen::Matrix4d::Zero()),
        areas_(VertexAreas(mesh)),
        normals_(VertexNormals(mesh)),
        vertices_(static_cast<int>(mesh.vertices.size())) {
    const std::vector<std::vector<int>> loops = BoundaryLoops(mesh.triangles);
    Require(loops.size() == 1,
            fmt::format("decimation: the mesh has {} boundary loops, expected 1", loops.size()));
    boundary_ = static_cast<int>(loops[0].size());
    boundary_size_ = BoundaryLength(mesh, loops[0]) / options.boundary_vertices;
    for (const Eigen::Vector3i& t : mesh.triangles) AddQuadric(mesh, t);
  }

  void Run() {
    while (Excess() > 0 || BoundaryExcess() > 0) {
      const int before = vertices_;
      // Filled anew from time to time: a collapse that was refused may have become possible.
      FillQueue();
      while (!queue_.empty() && vertices_ > 0.8 * before && (Excess() > 0 || BoundaryExcess() > 0))
        Step();
      Require(
          vertices_ < before,
          fmt::format("decimation: stopped at {} vertices, {} on the boundary; wanted {} and {}",
                      vertices_, boundary_, options_.vertices, options_.boundary_vertices));
    }
    Require(vertices_ == options_.vertices && boundary_ == options_.boundary_vertices,
            "decimation: the mesh has fewer vertices than wanted");
  }

  EditMesh& Result() { return edit_; }

 private:
  using Candidate = std::tuple<double, int, int>;  // cost, vertex that goes, vertex that stays

  int Excess() const { return vertices_ - options_.vertices; }
  int BoundaryExcess() const { return boundary_ - options_.boundary_vertices; }

  void AddQuadric(const TriangleMesh& mesh, const Eigen::Vector3i& t) {
    const Eigen::Vector3d a = mesh.vertices[At(t[0])];
    const Eigen::Vector3d cross = (mesh.vertices[At(t[1])] - a).cross(mesh.vertices[At(t[2])] - a);
    const Eigen::Vector3d normal = cross.stableNormalized();
    Eigen::Vector4d plane;
    plane << normal, -normal.dot(a);
    for (const int v : t) quadrics_[At(v)] += cross.norm() / 6 * plane * plane.transpose();
  }

  std::optional<double> Cost(int u, int v) const {
    const bool boundary = edit_.OnBoundary(u);
    if (boundary ? BoundaryExcess() <= 0 : Excess() <= BoundaryExcess()) return std::nullopt;
    if (!edit_.CollapseKeepsTopology(u, v)) return std::nullopt;
    const EditMesh::MoveEffect effect = edit_.EffectOfMove(u, edit_.Position(v), v);
    if (effect.cosine < options_.min_normal_cosine) return std::nullopt;
    const double before = edit_.EffectOfMove(u, edit_.Position(u), -1).quality;
    if (effect.quality < std::min(options_.min_quality, before)) return std::nullopt;
    const double size = boundary ? boundary_size_ : 0.5 * (sizes_[At(u)] + sizes_[At(v)]);
    Eigen::Vector4d position;
    position << edit_.Position(v), 1;
    const double squared = position.dot((quadrics_[At(u)] + quadrics_[At(v)]) * position) /
                           (areas_[At(u)] + areas_[At(v)]);
    const double length = (edit_.Position(u) - edit_.Position(v)).norm();
    const double turned = 1 + options_.facing_weight * std::max(0.0, 0.2 - FacingAfter(u, v));
    return turned *
           (length * (1.5 - 0.5 * effect.quality) +
            options_.error_weight * std::sqrt(std::max(0.0, squared))) /
           size;
  }

  /// Least cosine between the normals of the triangles that a collapse changes and the source's
  /// normals at their corners.
  double FacingAfter(int u, int v) const {
    double facing = 1;
    for (const int t : edit_.TrianglesOf(u)) {
      Eigen::Vector3i c = edit_.Triangle(t);
      if ((c.array() == v).any()) continue;
      const Eigen::Vector3d normal = edit_.Normal(t, u, edit_.Position(v));
      c = (c.array() == u).select(v, c);
      for (const int corner : c) facing = std::min(facing, normal.dot(normals_[At(corner)]));
    }
    return facing;
  }

  void Push(int u, int v) {
    const std::optional<double> cost = Cost(u, v);
    if (cost) queue_.emplace(*cost, u, v);
  }

  void FillQueue() {
    queue_ = {};
    for (int u = 0; u < static_cast<int>(edit_.NumVertices()); ++u) {
      if (!edit_.Alive(u)) continue;
      for (const int v : edit_.Neighbours(u)) Push(u, v);
    }
  }

  void Step() {
    const auto [cost, u, v] = queue_.top();
    queue_.pop();
    if (!edit_.Alive(u) || !edit_.Alive(v) || edit_.TrianglesOfEdge(u, v).empty()) return;
    const std::optional<double> now = Cost(u, v);
    if (!now) return;
    if (*now > 1.05 * cost + 1e-9) {
      queue_.emplace(*now, u, v);
      return;
    }
    if (edit_.OnBoundary(u)) --boundary_;
    --vertices_;
    edit_.Collapse(u, v);
    quadrics_[At(v)] += quadrics_[At(u)];
    areas_[At(v)] += areas_[At(u)];
    for (const int w : edit_.Neighbours(v)) {
      Push(v, w);
      Push(w, v);
    }
  }

  DecimationOptions options_;
  std::vector<double> sizes_;
  EditMesh edit_;
  std::vector<Eigen::Matrix4d> quadrics_;
  std::vector<double> areas_;
  std::vector<Eigen::Vector3d> normals_;
  int vertices_ = 0, boundary_ = 0;
  double boundary_size_ = 0;
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> queue_;
};

}  // namespace

SubsetMesh Decimate(const TriangleMesh& mesh, std::span<const double> size,
                    const DecimationOptions& options) {
  Require(size.size() == mesh.vertices.size(), "decimation: one size per vertex is needed");
  Require(IsOrientedManifold(mesh.vertices.size(), mesh.triangles),
          "decimation: the mesh is not an oriented manifold");
  const std::vector<double> sizes = AbsoluteSizes(mesh, size, options.vertices);
  Decimator decimator(mesh, sizes, options);
  decimator.Run();
  return RelaxSubset(mesh, decimator.Result(), sizes, options.improve_rounds);
}

TriangleMesh MeshFrom(const TriangleMesh& source, const SubsetMesh& subset) {
  TriangleMesh mesh;
  for (const int v : subset.vertices) mesh.vertices.push_back(source.vertices.at(At(v)));
  mesh.triangles = subset.triangles;
  return mesh;
}

}  // namespace sole::model
