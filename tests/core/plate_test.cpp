#include "core/plate.h"

#include <cmath>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "core/rig_config.h"
#include "tests/support/jacobian_checker.h"

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
    const Eigen::Vector3d seen = ApparentPoint({0.015, 1.52}, centre, point) - centre;
    EXPECT_NEAR(std::atan2(seen.head<2>().norm(), seen.z()), angle, 1e-11) << degrees;
  }
}

TEST(ApparentPoint, IsTheIdentityOnTheCamerasOwnSide) {
  const Eigen::Vector3d point(0.1, 0.05, 0.02);
  EXPECT_EQ(ApparentPoint({0.015, 1.52}, Eigen::Vector3d(0.3, 0.1, 0.5), point), point);
}

TEST(ApparentPoint, JacobiansMatchDifferences) {
  // Through the whole plate, into it, from above, and straight ahead where the direction is not defined.
  struct Case {
    Eigen::Vector3d centre, point;
  };
  const Case cases[] = {{{0.02, -0.01, -0.6}, {0.3, 0.4, 0.03}},
                        {{0.02, -0.01, -0.6}, {0.1, 0.05, -0.004}},
                        {{0.1, 0.2, 0.5}, {-0.1, 0.05, -0.3}},
                        {{0.1, 0.2, 0.5}, {-0.1, 0.05, 0.1}},
                        {{0.1, 0.2, -0.5}, {0.1, 0.2, 0.1}}};
  for (const Case& c : cases) {
    Eigen::VectorXd x(7);
    x << c.point, c.centre, 0.0151;
    ApparentPointJacobian by;
    ApparentPoint({x[6], 1.52}, c.centre, c.point, &by);
    Eigen::MatrixXd jacobian(2, 7);
    jacobian << by.point, by.centre, by.thickness_m;
    testing_support::ExpectJacobianNear(
        [](const Eigen::VectorXd& at) -> Eigen::VectorXd {
          return ApparentPoint({at[6], 1.52}, at.segment<3>(3), at.head<3>()).head<2>();
        },
        x, jacobian, 1e-8, 1e-6);
  }
}

TEST(Projector, ForwardProjectionIsExactToAMillionthOfAPixel) {
  // Against bisection of Snell's law, over the whole field of a camera that looks up obliquely.
  CameraConfig config;
  config.position_m = {0.25, 0.1, -0.45};
  Camera camera{"", 1624, 1236, {}, NominalCamFromWorld(config)};
  camera.intrinsics << 3250, 3251, 810, 615, -0.08, 0.05, 2e-4, -3e-4, 0.01;
  const Plate plate;
  const Projector projector(camera, plate);
  const Eigen::Vector3d centre = camera.CentreInWorld();
  for (double x = -0.1; x < 0.11; x += 0.04) {
    for (double y = -0.2; y < 0.21; y += 0.04) {
      for (const double z : {0.0, 0.05, 0.15}) {
        const Eigen::Vector2d lateral = Eigen::Vector2d(x, y) - centre.head<2>();
        double low = 0, high = 1.5;
        for (int i = 0; i < 100; ++i) {
          const double angle = 0.5 * (low + high);
          const bool short_of = LateralAtHeight(centre.z(), angle, plate.thickness_m, plate.index,
                                                z) < lateral.norm();
          (short_of ? low : high) = angle;
        }
        Eigen::Vector3d direction;
        direction << std::sin(low) * lateral.normalized(), std::cos(low);
        const Eigen::Vector2d traced = PixelFromPointInCam<double>(
            camera.intrinsics.data(), camera.cam_from_world.rotation * direction);
        EXPECT_LT((projector({x, y, z}) - traced).norm(), 1e-7) << x << " " << y << " " << z;
      }
    }
  }
}

TEST(Projector, ManyPointsAtOnceAreTheSamePointsOneByOne) {
  // On both sides of the glass, in it, at the camera's height and behind it; a number of points
  // that leaves a remainder.
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (const double z : {-0.45, 0.5}) {
    CameraConfig config;
    config.position_m = {0.25, 0.1, z};
    Camera camera{"", 1624, 1236, {}, NominalCamFromWorld(config)};
    camera.intrinsics << 3250, 3251, 810, 615, -0.08, 0.05, 2e-4, -3e-4, 0.01;
    const Projector projector(camera, Plate{});
    std::vector<Eigen::Vector3d> points(203);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double heights[] = {0.1 * uniform(random), -0.007, 1.5 * z, 0.7 * uniform(random), 0.0};
      points[i] << 0.3 * uniform(random), 0.4 * uniform(random), heights[i % 5];
    }
    points.back().z() = projector.centre.z();
    points[5] = projector.centre;
    std::vector<Eigen::Vector2d> pixels(points.size());
    projector(points, pixels);
    int behind = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector2d one = projector(points[i]);
      ASSERT_EQ(pixels[i].array().isNaN().any(), one.array().isNaN().any()) << points[i].transpose();
      behind += one.array().isNaN().any();
      if (!one.array().isNaN().any() && one.norm() < 1e5) {
        EXPECT_LT((pixels[i] - one).norm(), 1e-7) << points[i].transpose();
      }
    }
    EXPECT_GT(behind, 5);
    EXPECT_LT(behind, 150);
  }
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
