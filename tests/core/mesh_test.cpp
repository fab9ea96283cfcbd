#include "core/mesh.h"

#include <cmath>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace sole {
namespace {

/// Octahedron with unit half-axes, triangles counter-clockwise from outside.
TriangleMesh Octahedron() {
  TriangleMesh mesh{{{1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}, {}};
  for (int i = 0; i < 4; ++i) {
    mesh.triangles.emplace_back(i, (i + 1) % 4, 4);
    mesh.triangles.emplace_back((i + 1) % 4, i, 5);
  }
  return mesh;
}

TEST(PositionOf, IsTheWeightedMeanOfTheCorners) {
  const TriangleMesh mesh{{{0, 0, 1}, {3, 0, 1}, {0, 6, 1}}, {{0, 1, 2}}};
  EXPECT_EQ(PositionOf(mesh, {0, {0, 1, 0}}), Eigen::Vector3d(3, 0, 1));
  EXPECT_LT((PositionOf(mesh, {0, {0.5, 0.25, 0.25}}) - Eigen::Vector3d(0.75, 1.5, 1)).norm(), 1e-15);
  EXPECT_THROW(PositionOf(mesh, {1, {1, 0, 0}}), std::out_of_range);
  EXPECT_THROW(PositionOf(mesh, {}), std::out_of_range);
}

TEST(VertexNormals, PointOutwardsOnASymmetricBody) {
  const TriangleMesh mesh = Octahedron();
  const std::vector<Eigen::Vector3d> normals = VertexNormals(mesh);
  ASSERT_EQ(normals.size(), 6U);
  for (std::size_t i = 0; i < 6; ++i) EXPECT_LT((normals[i] - mesh.vertices[i]).norm(), 1e-15) << i;
}

TEST(VertexNormals, WeighTrianglesByArea) {
  // At vertex 0 meet a triangle of area 1 facing +z and one of area 2 facing +x.
  const TriangleMesh mesh{{{0, 0, 0}, {-2, 0, 0}, {0, -1, 0}, {0, 2, 0}, {0, 0, 2}}, {{0, 1, 2}, {0, 3, 4}}};
  const Eigen::Vector3d expected = Eigen::Vector3d(2, 0, 1).normalized();
  EXPECT_LT((VertexNormals(mesh)[0] - expected).norm(), 1e-15);
}

TEST(VertexNormals, AreZeroWhereNoTriangleIs) {
  TriangleMesh mesh = Octahedron();
  mesh.vertices.emplace_back(5, 5, 5);
  EXPECT_EQ(VertexNormals(mesh).back(), Eigen::Vector3d::Zero());
}

TEST(VertexNormals, AreUnitOnTinyTriangles) {
  const double s = 1e-9;
  const TriangleMesh mesh{{{0, 0, 0}, {s, 0, 0}, {0, s, 0}}, {{0, 1, 2}}};
  EXPECT_LT((VertexNormals(mesh)[0] - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
}

}  // namespace
}  // namespace sole
