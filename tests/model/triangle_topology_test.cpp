#include "model/triangle_topology.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "test_meshes.h"

namespace sole::model {
namespace {

const std::vector<Eigen::Vector3i> kTetrahedron = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};

TEST(BoundaryLoops, AreTheRimInOrder) {
  const TriangleMesh mesh = testing::Bowl(5);
  const std::vector<std::vector<int>> loops = BoundaryLoops(mesh.triangles);
  ASSERT_EQ(loops.size(), 1U);
  ASSERT_EQ(loops[0].size(), 30U);
  for (std::size_t i = 0; i < 30; ++i) {
    const int a = loops[0][i], b = loops[0][(i + 1) % 30];
    EXPECT_GE(a, 61);
    EXPECT_TRUE(std::abs(a - b) == 1 || std::abs(a - b) == 29) << a << " " << b;
  }
  EXPECT_TRUE(BoundaryLoops(kTetrahedron).empty());
}

TEST(EulerCharacteristic, OfDiscAndSphere) {
  EXPECT_EQ(EulerCharacteristic(testing::Bowl(4).triangles), 1);
  EXPECT_EQ(EulerCharacteristic(kTetrahedron), 2);
}

TEST(IsOrientedManifold, RefusesFinsTurnedTrianglesAndPinchedVertices) {
  const TriangleMesh bowl = testing::Bowl(4);
  EXPECT_TRUE(IsOrientedManifold(bowl.vertices.size(), bowl.triangles));
  EXPECT_TRUE(IsOrientedManifold(4, kTetrahedron));
  std::vector<Eigen::Vector3i> bad = bowl.triangles;
  std::swap(bad[7][0], bad[7][1]);
  EXPECT_FALSE(IsOrientedManifold(bowl.vertices.size(), bad));
  bad = kTetrahedron;
  bad.emplace_back(0, 1, 4);
  EXPECT_FALSE(IsOrientedManifold(5, bad));
  // Two triangles that touch in a vertex only.
  EXPECT_FALSE(IsOrientedManifold(5, std::vector<Eigen::Vector3i>{{0, 1, 2}, {0, 3, 4}}));
}

TEST(TriangleQuality, IsOneForEquilateralAndZeroForDegenerate) {
  EXPECT_NEAR(TriangleQuality({0, 0, 0}, {2, 0, 0}, {1, std::sqrt(3.0), 0}), 1, 1e-12);
  EXPECT_NEAR(TriangleQuality({0, 0, 0}, {1, 0, 0}, {0, 1, 0}), std::sqrt(3.0) / 2, 1e-12);
  EXPECT_EQ(TriangleQuality({0, 0, 0}, {1, 0, 0}, {2, 0, 0}), 0);
}

TEST(VertexAreas, SumToTheSurface) {
  double sum = 0;
  for (const double area : VertexAreas(testing::Bowl(40))) sum += area;
  const double cap = 2 * M_PI * 0.05 * 0.05 * (1 - std::cos(140.0 / 180 * M_PI));
  EXPECT_NEAR(sum, cap, 2e-3 * cap);
}

}  // namespace
}  // namespace sole::model
