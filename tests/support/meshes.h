#pragma once

#include <algorithm>
#include <cmath>
#include <random>

#include <Eigen/Geometry>

#include "core/mesh.h"
#include "core/point_cloud.h"

namespace sole::testing_support {

/// Ellipsoid with half axes `axes` around the origin, rings x segments quads, closed, counter-clockwise seen
/// from outside.
inline TriangleMesh Ellipsoid(const Eigen::Vector3d& axes, int rings, int segments) {
  TriangleMesh mesh;
  mesh.vertices.push_back(Eigen::Vector3d(0, 0, -axes.z()));
  for (int r = 1; r < rings; ++r) {
    const double polar = M_PI * r / rings;
    for (int s = 0; s < segments; ++s) {
      const double turn = 2 * M_PI * s / segments;
      mesh.vertices.push_back({axes.x() * std::sin(polar) * std::cos(turn),
                               axes.y() * std::sin(polar) * std::sin(turn), -axes.z() * std::cos(polar)});
    }
  }
  mesh.vertices.push_back(Eigen::Vector3d(0, 0, axes.z()));
  const int last = static_cast<int>(mesh.vertices.size()) - 1;
  const auto at = [&](int r, int s) { return 1 + (r - 1) * segments + s % segments; };
  for (int s = 0; s < segments; ++s) {
    mesh.triangles.push_back({0, at(1, s + 1), at(1, s)});
    for (int r = 1; r + 1 < rings; ++r) {
      mesh.triangles.push_back({at(r, s), at(r, s + 1), at(r + 1, s)});
      mesh.triangles.push_back({at(r, s + 1), at(r + 1, s + 1), at(r + 1, s)});
    }
    mesh.triangles.push_back({at(rings - 1, s), at(rings - 1, s + 1), last});
  }
  return mesh;
}

/// Points drawn evenly over a mesh, moved along the normal by normal noise, with normals and sigma.
inline PointCloud SampleMesh(const TriangleMesh& mesh, int count, double noise_m, unsigned seed) {
  std::mt19937_64 random(seed);
  std::vector<double> cumulative;
  double total = 0;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const auto& v = mesh.vertices;
    const auto a = static_cast<std::size_t>(t[0]), b = static_cast<std::size_t>(t[1]), c = static_cast<std::size_t>(t[2]);
    total += (v[b] - v[a]).cross(v[c] - v[a]).norm();
    cumulative.push_back(total);
  }
  const std::vector<Eigen::Vector3d> normals = VertexNormals(mesh);
  std::uniform_real_distribution<double> unit(0, 1);
  std::normal_distribution<double> noise(0, noise_m);
  PointCloud cloud;
  for (int i = 0; i < count; ++i) {
    const auto at = std::lower_bound(cumulative.begin(), cumulative.end(), unit(random) * total);
    SurfacePoint point;
    point.triangle = static_cast<int>(std::min<std::ptrdiff_t>(at - cumulative.begin(), static_cast<std::ptrdiff_t>(cumulative.size()) - 1));
    const double root = std::sqrt(unit(random)), other = unit(random);
    point.barycentric = {1 - root, root * (1 - other), root * other};
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k) {
      normal += point.barycentric[k] *
                normals[static_cast<std::size_t>(mesh.triangles[static_cast<std::size_t>(point.triangle)][k])];
    }
    normal.normalize();
    cloud.points_m.push_back((PositionOf(mesh, point) + noise(random) * normal).cast<float>());
    cloud.normals.push_back(normal.cast<float>());
    cloud.sigma_m.push_back(static_cast<float>(std::max(noise_m, 1e-5)));
  }
  return cloud;
}

}  // namespace sole::testing_support
