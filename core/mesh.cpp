#include "core/mesh.h"

#include <cstddef>

#include <Eigen/Geometry>

namespace sole {

Eigen::Vector3d PositionOf(const TriangleMesh& mesh, const SurfacePoint& point) {
  const Eigen::Vector3i& t = mesh.triangles.at(static_cast<std::size_t>(point.triangle));
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int corner = 0; corner < 3; ++corner) {
    sum += point.barycentric[corner] * mesh.vertices.at(static_cast<std::size_t>(t[corner]));
  }
  return sum;
}

std::vector<Eigen::Vector3d> VertexNormals(const TriangleMesh& mesh) {
  std::vector<Eigen::Vector3d> normals(mesh.vertices.size(), Eigen::Vector3d::Zero());
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const auto a = static_cast<std::size_t>(t[0]), b = static_cast<std::size_t>(t[1]),
               c = static_cast<std::size_t>(t[2]);
    const Eigen::Vector3d cross =
        (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
    normals[a] += cross;
    normals[b] += cross;
    normals[c] += cross;
  }
  for (Eigen::Vector3d& normal : normals) normal.stableNormalize();
  return normals;
}

}  // namespace sole
