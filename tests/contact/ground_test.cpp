#include "contact/ground.h"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace sole::contact {
namespace {

/// Points of a tilted platform outside the foot, with `outliers` points that float above it.
PointCloud Platform(int points, int outliers, const GroundPlane& plane, double noise_m) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> x(0.095, 0.115), y(-0.14, 0.14), up(0.002, 0.02);
  std::normal_distribution<double> noise(0, noise_m);
  PointCloud cloud;
  for (int i = 0; i < points + outliers; ++i) {
    const double px = (i % 2 ? 1 : -1) * x(random), py = y(random);
    double z = plane.offset_m + plane.slope_x * px + plane.slope_y * py + noise(random);
    if (i >= points) z += up(random);
    cloud.points_m.emplace_back(Eigen::Vector3d(px, py, z).cast<float>());
    cloud.sigma_m.push_back(static_cast<float>(noise_m));
  }
  return cloud;
}

TEST(EstimateGround, FindsATiltedPlaneDespiteOutliers) {
  GroundPlane truth;
  truth.offset_m = -4e-5;
  truth.slope_x = 2e-4;
  truth.slope_y = -1e-4;
  const GroundPlane found = EstimateGround(Platform(4000, 800, truth, 3e-5));
  EXPECT_NEAR(found.offset_m, truth.offset_m, 6e-6);
  EXPECT_NEAR(found.slope_x, truth.slope_x, 6e-5);
  EXPECT_NEAR(found.slope_y, truth.slope_y, 6e-5);
  EXPECT_GT(found.points, 3800);
  EXPECT_LT(found.points, 4200);
}

TEST(EstimateGround, KeepsTheCalibratedPlaneWithoutPlatformPoints) {
  const GroundPlane found = EstimateGround(Platform(10, 0, {}, 3e-5));
  EXPECT_EQ(found.points, 0);
  EXPECT_EQ(found.offset_m, 0);
  EXPECT_EQ(found.sigma_m, GroundOptions{}.prior_sigma_m);
}

TEST(EstimateGround, IgnoresAFootThatSlippedIntoThePlatformPoints) {
  PointCloud cloud = Platform(300, 0, {}, 2e-5);
  for (int i = 0; i < 2000; ++i) {  // a slope of skin, more points than platform
    cloud.points_m.emplace_back(0.0001f * static_cast<float>(i % 50), 0.0f, 0.00001f * static_cast<float>(i));
    cloud.sigma_m.push_back(3e-5f);
  }
  const GroundPlane found = EstimateGround(cloud);
  EXPECT_NEAR(found.offset_m, 0, 2e-5);
}

/// A calibrated surface 0.2 mm above z = 0 whose fiducials lie 0.05 mm above z = 0, a bump in its middle.
GroundSurface Calibrated() {
  GroundSurface surface;
  surface.plane = {2e-4, 1e-4, 0};
  surface.first_node_m = {-0.1, -0.1};
  surface.spacing_m = 0.1;
  surface.nodes_x = surface.nodes_y = 3;
  surface.residual_m = {0, 0, 0, 0, 8e-5, 0, 0, 0, 0};
  surface.sigma_m.assign(9, 1e-6);
  for (const double y : {-0.13, 0.13}) {
    for (const double x : {-0.105, 0.105}) surface.marks.push_back({0, {x, y, 5e-5}, 2e-6});
  }
  return surface;
}

TEST(EstimateGround, MovesTheCalibratedSurfaceAsUncoveredGlassMoved) {
  // Uncovered glass is 0.03 mm lower than the fiducials were: so is the ground.
  GroundPlane seen;
  seen.offset_m = 2e-5;
  seen.slope_y = 1e-4;
  const GroundPlane found = EstimateGround(Platform(4000, 800, seen, 3e-5), Calibrated());
  EXPECT_NEAR(found.offset_m, 2e-4 - 3e-5, 6e-6);
  EXPECT_NEAR(found.slope_x, 1e-4, 6e-5);
  EXPECT_NEAR(found.slope_y, 1e-4, 6e-5);
  const GroundPlane kept = EstimateGround(Platform(10, 0, {}, 3e-5), Calibrated());
  EXPECT_EQ(kept.offset_m, 2e-4);
  EXPECT_EQ(kept.slope_x, 1e-4);
  EXPECT_EQ(kept.points, 0);
}

TEST(Gap, CountsTheCalibratedResidual) {
  GroundPlane ground;
  ground.offset_m = 1e-4;
  EXPECT_NEAR(Gap(ground, {0, 0, 0.001}, Calibrated()), 0.001 - 1e-4 - 8e-5, 1e-12);
  EXPECT_NEAR(Gap(ground, {0.05, 0, 0.001}, Calibrated()), 0.001 - 1e-4 - 4e-5, 1e-12);
  EXPECT_NEAR(Gap(ground, {0.1, 0.1, 0.001}, Calibrated()), 0.001 - 1e-4, 1e-12);
}

TEST(Gap, IsThePerpendicularDistanceToATiltedGround) {
  GroundPlane ground;
  ground.offset_m = 0.001;
  ground.slope_x = 0.75;  // cosine 0.8
  EXPECT_NEAR(Gap(ground, {0, 0, 0.011}), 0.008, 1e-12);
  EXPECT_NEAR(Gap(ground, {0.004, 0.3, 0.004}), 0, 1e-12);
}

}  // namespace
}  // namespace sole::contact
