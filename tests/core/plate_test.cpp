#include "core/plate.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/rig_config.h"

namespace sole {
namespace {

/// Snell's law traced surface by surface from a camera below: where a ray that leaves the camera at `angle`
/// to the vertical crosses height z.
double LateralAtHeight(double camera_z, double angle, double thickness, double index, double z) {
  const double inside = std::asin(std::sin(angle) / index);
  return (-thickness - camera_z) * std::tan(angle) + thickness * std::tan(inside) + z * std::tan(angle);
}

TEST(ApparentPoint, AgreesWithSnellTracedSurfaceBySurface) {
  const Eigen::Vector3d centre(0.02, -0.01, -0.6);
  for (double degrees = 0; degrees <= 60; degrees += 5) {
    const double angle = degrees * M_PI / 180;
    const double lateral = LateralAtHeight(centre.z(), angle, 0.015, 1.52, 0.03);
    const Eigen::Vector3d point(centre.x() + 0.6 * lateral, centre.y() + 0.8 * lateral, 0.03);
    const Eigen::Vector3d seen = ApparentPoint<double>(0.015, 1.52, centre, point) - centre;
    EXPECT_NEAR(std::atan2(seen.head<2>().norm(), seen.z()), angle, 1e-12) << degrees;
  }
}

TEST(ApparentPoint, IsTheIdentityOnTheCamerasOwnSide) {
  const Eigen::Vector3d point(0.1, 0.05, 0.02);
  EXPECT_EQ(ApparentPoint<double>(0.015, 1.52, Eigen::Vector3d(0.3, 0.1, 0.5), point), point);
}

TEST(RayFromPixel, InvertsPixelFromWorldThroughTheGlass) {
  const RigConfig config = MakeDefaultRig();
  for (const CameraConfig& camera_config : config.cameras) {
    Camera camera{"", camera_config.width, camera_config.height, {}, NominalCamFromWorld(camera_config)};
    camera.intrinsics << 3250, 3251, 810, 615, -0.08, 0.05, 2e-4, -3e-4, 0.01;
    for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.03, 0.1, 0.0), Eigen::Vector3d(-0.02, -0.08, 0.07)}) {
      const Ray ray = RayFromPixel(camera, Plate{}, PixelFromWorld(camera, Plate{}, point));
      EXPECT_LT((point - ray.origin).cross(ray.direction).norm(), 1e-10);
    }
  }
}

TEST(IntersectRays, FindsTheCommonPoint) {
  const Eigen::Vector3d point(0.1, -0.2, 0.3), a(1, 2, 3), b(-2, 0.5, 1);
  const RayIntersection hit = IntersectRays({a, (point - a).normalized()}, {b, (point - b).normalized()});
  EXPECT_LT((hit.point - point).norm(), 1e-12);
  EXPECT_LT(hit.gap_m, 1e-12);
}

TEST(MakeDefaultRig, ImageAxesFollowTheDocumentedPlacement) {
  for (const int cameras : {4, 8, 20}) {
    const RigConfig config = MakeDefaultRig(cameras);
    EXPECT_NO_THROW(Validate(config));
    ASSERT_EQ(config.cameras.size(), static_cast<std::size_t>(cameras));
    for (const PairConfig& pair : config.pairs) {
      const Rigid3 left = NominalCamFromWorld(config.cameras[static_cast<std::size_t>(CameraIndex(config, pair.left))]);
      const Rigid3 right = NominalCamFromWorld(config.cameras[static_cast<std::size_t>(CameraIndex(config, pair.right))]);
      const Eigen::Vector3d right_in_left = left * right.Inverse().translation;
      EXPECT_GT(right_in_left.x(), 0.1) << pair.name;
      EXPECT_LT(std::abs(right_in_left.y()), 0.3 * right_in_left.x()) << pair.name;
    }
  }
}

}  // namespace
}  // namespace sole
