#pragma once

#include <vector>

#include <Eigen/Core>

namespace sole {

/// Triangle mesh in metres; triangles are counter-clockwise seen from outside.
struct TriangleMesh {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Eigen::Vector3i> triangles;
};

/// A point of a surface: triangle index and barycentric coordinates (sum 1).
struct SurfacePoint {
  int triangle = -1;
  Eigen::Vector3d barycentric = Eigen::Vector3d::Zero();
};

/// Position of a surface point on a mesh.
Eigen::Vector3d PositionOf(const TriangleMesh& mesh, const SurfacePoint& point);

/// Area-weighted unit vertex normals.
std::vector<Eigen::Vector3d> VertexNormals(const TriangleMesh& mesh);

}  // namespace sole
