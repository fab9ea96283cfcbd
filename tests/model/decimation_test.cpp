#include "model/decimation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <set>

#include "core/error.h"
#include "model/triangle_topology.h"
#include "test_meshes.h"

namespace sole::model {
namespace {

std::vector<double> Uniform(const TriangleMesh& mesh) {
  return std::vector<double>(mesh.vertices.size(), 1.0);
}

TEST(Decimate, ReachesTheCountsAndKeepsTheTopology) {
  const TriangleMesh bowl = testing::Bowl(30);
  const SubsetMesh subset =
      Decimate(bowl, Uniform(bowl), {.vertices = 266, .boundary_vertices = 15});
  ASSERT_EQ(subset.vertices.size(), 266U);
  EXPECT_EQ(subset.triangles.size(), 515U);
  EXPECT_EQ(EulerCharacteristic(subset.triangles), 1);
  EXPECT_TRUE(IsOrientedManifold(266, subset.triangles));
  const std::vector<std::vector<int>> loops = BoundaryLoops(subset.triangles);
  ASSERT_EQ(loops.size(), 1U);
  EXPECT_EQ(loops[0].size(), 15U);
  // The rim stays on the rim.
  for (const int v : loops[0])
    EXPECT_GE(subset.vertices[static_cast<std::size_t>(v)], 1 + 3 * 30 * 29);
}

TEST(Decimate, VerticesAreASubsetOfTheSource) {
  const TriangleMesh bowl = testing::Bowl(20);
  const SubsetMesh subset =
      Decimate(bowl, Uniform(bowl), {.vertices = 200, .boundary_vertices = 30});
  EXPECT_TRUE(std::is_sorted(subset.vertices.begin(), subset.vertices.end()));
  EXPECT_EQ(std::set<int>(subset.vertices.begin(), subset.vertices.end()).size(), 200U);
  const TriangleMesh mesh = MeshFrom(bowl, subset);
  for (std::size_t i = 0; i < 200; ++i) {
    EXPECT_EQ(mesh.vertices[i], bowl.vertices.at(static_cast<std::size_t>(subset.vertices[i])));
  }
}

TEST(Decimate, MakesRegularTrianglesThatFaceOutwards) {
  const TriangleMesh bowl = testing::Bowl(30);
  const TriangleMesh mesh =
      MeshFrom(bowl, Decimate(bowl, Uniform(bowl), {.vertices = 400, .boundary_vertices = 30}));
  double worst = 1;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const auto at = [&](int corner) { return mesh.vertices[static_cast<std::size_t>(t[corner])]; };
    worst = std::min(worst, TriangleQuality(at(0), at(1), at(2)));
    EXPECT_GT((at(1) - at(0)).cross(at(2) - at(0)).dot(at(0) + at(1) + at(2)), 0);
  }
  EXPECT_GT(worst, 0.4);
}

TEST(Decimate, FollowsTheSizeField) {
  const TriangleMesh bowl = testing::Bowl(30);
  std::vector<double> size;
  for (const Eigen::Vector3d& v : bowl.vertices) size.push_back(v.x() > 0 ? 0.5 : 1.0);
  const TriangleMesh mesh =
      MeshFrom(bowl, Decimate(bowl, size, {.vertices = 500, .boundary_vertices = 30}));
  const auto fine = std::count_if(mesh.vertices.begin(), mesh.vertices.end(),
                                  [](const Eigen::Vector3d& v) { return v.x() > 0; });
  // Half the edge length means four times the vertices.
  EXPECT_NEAR(static_cast<double>(fine) / (500.0 - static_cast<double>(fine)), 4, 1.2);
}

TEST(Decimate, IsDeterministic) {
  const TriangleMesh bowl = testing::Bowl(15);
  const DecimationOptions options{.vertices = 150, .boundary_vertices = 20};
  EXPECT_EQ(Decimate(bowl, Uniform(bowl), options).vertices,
            Decimate(bowl, Uniform(bowl), options).vertices);
}

TEST(Decimate, RefusesImpossibleRequests) {
  const TriangleMesh bowl = testing::Bowl(5);
  EXPECT_THROW(Decimate(bowl, Uniform(bowl), {.vertices = 200, .boundary_vertices = 15}), Error);
  EXPECT_THROW(
      Decimate(bowl, std::vector<double>(3, 1.0), {.vertices = 50, .boundary_vertices = 15}),
      Error);
  TriangleMesh broken = bowl;
  std::swap(broken.triangles[3][0], broken.triangles[3][1]);
  EXPECT_THROW(Decimate(broken, Uniform(broken), {.vertices = 50, .boundary_vertices = 15}), Error);
}

}  // namespace
}  // namespace sole::model
