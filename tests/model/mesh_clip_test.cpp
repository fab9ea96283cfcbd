#include "model/mesh_clip.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/error.h"
#include "model/triangle_topology.h"
#include "test_meshes.h"

namespace sole::model {
namespace {

double Area(const TriangleMesh& mesh) {
  double sum = 0;
  for (const double area : VertexAreas(mesh)) sum += area;
  return sum;
}

TEST(ClipBelow, CutsExactlyAndRemembersTheSource) {
  const TriangleMesh bowl = testing::Bowl(30);
  const ClippedMesh clipped = ClipBelow(bowl, 0.0123);
  EXPECT_TRUE(IsOrientedManifold(clipped.mesh.vertices.size(), clipped.mesh.triangles));
  EXPECT_EQ(EulerCharacteristic(clipped.mesh.triangles), 1);
  const std::vector<std::vector<int>> loops = BoundaryLoops(clipped.mesh.triangles);
  ASSERT_EQ(loops.size(), 1U);
  for (const int v : loops[0])
    EXPECT_NEAR(clipped.mesh.vertices[static_cast<std::size_t>(v)].z(), 0.0123, 1e-6);
  ASSERT_EQ(clipped.source.size(), clipped.mesh.vertices.size());
  for (std::size_t v = 0; v < clipped.source.size(); ++v) {
    EXPECT_LT((PositionOf(bowl, clipped.source[v]) - clipped.mesh.vertices[v]).norm(), 1e-15);
    EXPECT_LE(clipped.mesh.vertices[v].z(), 0.0123 + 1e-6);
  }
  // Area of a spherical cap: 2 pi r h.
  const double cap = 2 * M_PI * 0.05 * 0.0623;
  EXPECT_NEAR(Area(clipped.mesh), cap, 3e-3 * cap);
}

TEST(ClipBelow, KeepsTheLargestPart) {
  TriangleMesh two = testing::Bowl(10);
  const int offset = static_cast<int>(two.vertices.size());
  for (const Eigen::Vector3d& v : testing::Bowl(3).vertices)
    two.vertices.push_back(v + Eigen::Vector3d(1, 0, 0));
  for (const Eigen::Vector3i& t : testing::Bowl(3).triangles)
    two.triangles.push_back(t + Eigen::Vector3i::Constant(offset));
  for (const Eigen::Vector3d& v : ClipBelow(two, 0.0).mesh.vertices) EXPECT_LT(v.x(), 0.1);
}

TEST(ClipBelow, RefusesAHeightBelowEverything) {
  EXPECT_THROW(ClipBelow(testing::Bowl(3), -1), Error);
}

}  // namespace
}  // namespace sole::model
