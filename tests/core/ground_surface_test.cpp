#include "core/ground_surface.h"

#include <gtest/gtest.h>

#include "core/error.h"

namespace sole {
namespace {

/// 3 by 2 nodes over x 0 to 0.2, y 0 to 0.1.
GroundSurface Surface() {
  GroundSurface surface;
  surface.plane = {0.001, 0.01, -0.02};
  surface.first_node_m = {0, 0};
  surface.spacing_m = 0.1;
  surface.nodes_x = 3;
  surface.nodes_y = 2;
  surface.residual_m = {0, 1e-4, 4e-4, 2e-4, 3e-4, 8e-4};
  surface.sigma_m.assign(6, 1e-6);
  return surface;
}

TEST(GroundSurface, IsBilinearBetweenItsNodes) {
  const GroundSurface surface = Surface();
  EXPECT_NEAR(ResidualAt(surface, {0.1, 0.1}), 3e-4, 1e-15);
  EXPECT_NEAR(ResidualAt(surface, {0.2, 0}), 4e-4, 1e-15);
  EXPECT_NEAR(ResidualAt(surface, {0.15, 0.05}), 4e-4, 1e-15);  // mean of 1, 4, 3, 8
  EXPECT_NEAR(HeightAt(surface, {0.15, 0.05}), 0.001 + 0.0015 - 0.001 + 4e-4, 1e-15);
}

TEST(GroundSurface, ResidualStaysConstantBeyondTheGrid) {
  const GroundSurface surface = Surface();
  EXPECT_NEAR(ResidualAt(surface, {-1, -1}), 0, 1e-15);
  EXPECT_NEAR(ResidualAt(surface, {5, 0.1}), 8e-4, 1e-15);
  EXPECT_NEAR(ResidualAt(surface, {0.1, 7}), 3e-4, 1e-15);
}

TEST(GroundSurface, WithoutAGridIsAPlane) {
  GroundSurface surface;
  EXPECT_EQ(HeightAt(surface, {0.3, -0.2}), 0);
  surface.plane.slope_y = 1e-3;
  EXPECT_DOUBLE_EQ(HeightAt(surface, {0.3, -0.2}), -2e-4);
}

TEST(PlaneThrough, GoesThroughThreeMarksAndBetweenMoreByTheirSigmas) {
  std::vector<GroundMark> marks{
      {1, {0, 0, 0.001}, 1e-6}, {2, {0.1, 0, 0.002}, 1e-6}, {3, {0, 0.1, 0.001}, 1e-6}};
  const HeightPlane plane = PlaneThrough(marks);
  EXPECT_NEAR(plane.offset_m, 0.001, 1e-12);
  EXPECT_NEAR(plane.slope_x, 0.01, 1e-11);
  EXPECT_NEAR(plane.slope_y, 0, 1e-11);
  marks.push_back({4, {0.1, 0.1, 0.003}, 1});  // knows nothing
  EXPECT_NEAR(PlaneThrough(marks).At({0.1, 0.1}), 0.002, 1e-9);
  marks.resize(2);
  EXPECT_THROW(PlaneThrough(marks), Error);
}

TEST(MarksPlane, IsTheSurfacesOwnWithoutMarks) {
  GroundSurface surface = Surface();
  EXPECT_EQ(MarksPlane(surface).slope_x, 0.01);
  surface.marks = {{1, {0, 0, 0.5}, 1e-6}, {2, {1, 0, 0.5}, 1e-6}, {3, {0, 1, 0.5}, 1e-6}};
  EXPECT_NEAR(MarksPlane(surface).offset_m, 0.5, 1e-12);
}

}  // namespace
}  // namespace sole
