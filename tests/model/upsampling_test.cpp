#include "model/upsampling.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "test_meshes.h"

namespace sole::model {
namespace {

TEST(HarmonicUpsampling, IsAConvexCombinationAndTheIdentityOnCoarseVertices) {
  const TriangleMesh bowl = testing::Bowl(10);
  const std::vector<UpsamplingRow> rows = HarmonicUpsampling(bowl, 40, 5);
  ASSERT_EQ(rows.size(), bowl.vertices.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    double sum = 0;
    EXPECT_LE(rows[i].size(), 5U);
    for (const auto& [vertex, weight] : rows[i]) {
      EXPECT_LT(vertex, 40);
      EXPECT_GT(weight, 0);
      sum += weight;
    }
    EXPECT_NEAR(sum, 1, 1e-12);
    if (i < 40) {
      EXPECT_EQ(rows[i], (UpsamplingRow{{static_cast<int>(i), 1.0}}));
    }
  }
}

TEST(HarmonicUpsampling, ReproducesLinearFunctionsOnAFlatGrid) {
  // Coarse: the border of a regular 7 x 7 grid; harmonic functions are then determined inside, and
  // linear ones are harmonic.
  TriangleMesh grid;
  std::vector<std::vector<int>> index(7, std::vector<int>(7, -1));
  for (const bool border : {true, false}) {
    for (std::size_t x = 0; x < 7; ++x) {
      for (std::size_t y = 0; y < 7; ++y) {
        if ((x == 0 || y == 0 || x == 6 || y == 6) != border) continue;
        index[x][y] = static_cast<int>(grid.vertices.size());
        grid.vertices.emplace_back(static_cast<double>(x), static_cast<double>(y), 0);
      }
    }
  }
  for (std::size_t x = 0; x < 6; ++x) {
    for (std::size_t y = 0; y < 6; ++y) {
      grid.triangles.emplace_back(index[x][y], index[x + 1][y], index[x + 1][y + 1]);
      grid.triangles.emplace_back(index[x][y], index[x + 1][y + 1], index[x][y + 1]);
    }
  }
  const std::vector<UpsamplingRow> rows = HarmonicUpsampling(grid, 24, 24);
  for (std::size_t i = 24; i < 49; ++i) {
    double value = 0;
    for (const auto& [vertex, weight] : rows[i])
      value +=
          weight * grid.vertices[static_cast<std::size_t>(vertex)].dot(Eigen::Vector3d(2, -3, 0));
    EXPECT_NEAR(value, grid.vertices[i].dot(Eigen::Vector3d(2, -3, 0)), 0.02);
  }
}

TEST(HarmonicUpsampling, RefusesImpossibleNumbers) {
  EXPECT_THROW(HarmonicUpsampling(testing::Bowl(2), 0), Error);
}

}  // namespace
}  // namespace sole::model
