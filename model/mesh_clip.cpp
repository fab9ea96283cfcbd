#include "model/mesh_clip.h"

#include <algorithm>
#include <cstddef>
#include <map>
#include <numeric>
#include <utility>

#include "core/error.h"

namespace sole::model {
namespace {

std::size_t At(int index) { return static_cast<std::size_t>(index); }

class Clipper {
 public:
  Clipper(const TriangleMesh& mesh, double height_m) : mesh_(mesh), height_(height_m) {}

  ClippedMesh Run() {
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) AddTriangle(static_cast<int>(t));
    return std::move(result_);
  }

 private:
  bool Below(int vertex) const { return mesh_.vertices[At(vertex)].z() < height_; }

  int AddVertex(const SurfacePoint& source) {
    result_.mesh.vertices.push_back(PositionOf(mesh_, source));
    result_.source.push_back(source);
    return static_cast<int>(result_.mesh.vertices.size()) - 1;
  }

  int CornerVertex(int triangle, int corner) {
    const auto [it, fresh] = corners_.try_emplace(mesh_.triangles[At(triangle)][corner], 0);
    if (fresh) it->second = AddVertex({triangle, Eigen::Vector3d::Unit(corner)});
    return it->second;
  }

  /// Vertex where the edge between two corners crosses the plane.
  int EdgeVertex(int triangle, int corner, int other) {
    const Eigen::Vector3i& t = mesh_.triangles[At(triangle)];
    const auto [it, fresh] = edges_.try_emplace(std::minmax(t[corner], t[other]), 0);
    if (fresh) {
      const double from = mesh_.vertices[At(t[corner])].z(), to = mesh_.vertices[At(t[other])].z();
      const double share = std::clamp((height_ - from) / (to - from), 1e-4, 1 - 1e-4);
      it->second = AddVertex({triangle, (1 - share) * Eigen::Vector3d::Unit(corner) +
                                            share * Eigen::Vector3d::Unit(other)});
    }
    return it->second;
  }

  void AddTriangle(int triangle) {
    const Eigen::Vector3i& t = mesh_.triangles[At(triangle)];
    std::vector<int> polygon;
    for (int corner = 0; corner < 3; ++corner) {
      const int other = (corner + 1) % 3;
      if (Below(t[corner])) polygon.push_back(CornerVertex(triangle, corner));
      if (Below(t[corner]) != Below(t[other]))
        polygon.push_back(EdgeVertex(triangle, corner, other));
    }
    for (std::size_t i = 2; i < polygon.size(); ++i) {
      result_.mesh.triangles.emplace_back(polygon[0], polygon[i - 1], polygon[i]);
    }
  }

  const TriangleMesh& mesh_;
  const double height_;
  ClippedMesh result_;
  std::map<int, int> corners_;
  std::map<std::pair<int, int>, int> edges_;
};

/// Component of each vertex, by union-find.
std::vector<int> Components(const TriangleMesh& mesh) {
  std::vector<int> parent(mesh.vertices.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto find = [&](int v) {
    while (parent[At(v)] != v) v = parent[At(v)] = parent[At(parent[At(v)])];
    return v;
  };
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int corner = 1; corner < 3; ++corner) parent[At(find(t[corner]))] = find(t[0]);
  }
  for (std::size_t v = 0; v < parent.size(); ++v) parent[v] = find(static_cast<int>(v));
  return parent;
}

ClippedMesh LargestPart(const ClippedMesh& clipped) {
  const std::vector<int> component = Components(clipped.mesh);
  std::map<int, int> sizes;
  for (const int c : component) ++sizes[c];
  const int largest =
      std::max_element(sizes.begin(), sizes.end(), [](const auto& a, const auto& b) {
        return a.second < b.second;
      })->first;
  ClippedMesh part;
  std::vector<int> renumbered(component.size(), -1);
  for (std::size_t v = 0; v < component.size(); ++v) {
    if (component[v] != largest) continue;
    renumbered[v] = static_cast<int>(part.mesh.vertices.size());
    part.mesh.vertices.push_back(clipped.mesh.vertices[v]);
    part.source.push_back(clipped.source[v]);
  }
  for (const Eigen::Vector3i& t : clipped.mesh.triangles) {
    if (component[At(t[0])] != largest) continue;
    part.mesh.triangles.emplace_back(renumbered[At(t[0])], renumbered[At(t[1])],
                                     renumbered[At(t[2])]);
  }
  return part;
}

}  // namespace

ClippedMesh ClipBelow(const TriangleMesh& mesh, double height_m) {
  const ClippedMesh clipped = Clipper(mesh, height_m).Run();
  Require(!clipped.mesh.triangles.empty(), "mesh clipping: nothing lies below the height given");
  return LargestPart(clipped);
}

}  // namespace sole::model
