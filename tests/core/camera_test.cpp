#include "core/camera.h"

#include <gtest/gtest.h>

#include "tests/support/jacobian_checker.h"

namespace sole {
namespace {

Intrinsics Lens() {
  Intrinsics intrinsics;
  intrinsics << 3250, 3247, 812, 617, -0.11, 0.09, 4e-4, -6e-4, 0.02;
  return intrinsics;
}

TEST(Distort, FollowsTheBrownConradyFormulaTermByTerm) {
  // r2 = 0.25 at (0.3, 0.4); each coefficient alone.
  const Eigen::Vector2d n(0.3, 0.4);
  const auto shift = [&](int which) {
    double k[5] = {0, 0, 0, 0, 0};
    k[which] = 1;
    return Eigen::Vector2d(Distort(k, n) - n);
  };
  EXPECT_LT((shift(0) - 0.25 * n).norm(), 1e-15);
  EXPECT_LT((shift(1) - 0.0625 * n).norm(), 1e-15);
  EXPECT_LT((shift(4) - 0.015625 * n).norm(), 1e-15);
  EXPECT_LT((shift(2) - Eigen::Vector2d(2 * 0.12, 0.25 + 2 * 0.16)).norm(), 1e-15);  // p1
  EXPECT_LT((shift(3) - Eigen::Vector2d(0.25 + 2 * 0.09, 2 * 0.12)).norm(), 1e-15);  // p2
}

TEST(PixelFromPointInCam, WithoutDistortionIsTheDirectProjection) {
  Intrinsics intrinsics = Lens();
  intrinsics.tail<5>().setZero();
  const Eigen::Vector2d pixel = PixelFromPointInCam<double>(intrinsics.data(), Eigen::Vector3d(0.1, -0.2, 0.5));
  EXPECT_NEAR(pixel.x(), 3250 * 0.2 + 812, 1e-10);
  EXPECT_NEAR(pixel.y(), 3247 * -0.4 + 617, 1e-10);
}

TEST(NormalizedFromPixel, InvertsTheProjectionOverTheWholeImage) {
  const Intrinsics intrinsics = Lens();
  for (int y = 0; y <= 1236; y += 103) {
    for (int x = 0; x <= 1624; x += 116) {
      const Eigen::Vector2d pixel(x, y);
      const Eigen::Vector2d n = NormalizedFromPixel(intrinsics, pixel);
      const Eigen::Vector3d point(n.x(), n.y(), 1);
      EXPECT_LT((PixelFromPointInCam<double>(intrinsics.data(), point) - pixel).norm(), 1e-9) << x << ", " << y;
    }
  }
}

TEST(NormalizedFromPixel, ConvergesForStrongDistortion) {
  Intrinsics intrinsics;
  intrinsics << 900, 910, 640, 480, -0.32, 0.14, 2e-3, -3e-3, -0.03;
  for (const Eigen::Vector2d& n : {Eigen::Vector2d(0.6, -0.5), Eigen::Vector2d(-0.7, 0.3), Eigen::Vector2d(0, 0)}) {
    const Eigen::Vector2d pixel = PixelFromPointInCam<double>(intrinsics.data(), Eigen::Vector3d(n.x(), n.y(), 1));
    EXPECT_LT((NormalizedFromPixel(intrinsics, pixel) - n).norm(), 1e-11);
  }
}

TEST(Camera, CentreInWorldIsWhereTheCameraMapsToTheOrigin) {
  Camera camera;
  camera.cam_from_world = {Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5), Eigen::Vector3d(1, 2, 3)};
  EXPECT_LT((camera.cam_from_world * camera.CentreInWorld()).norm(), 1e-14);
  EXPECT_GT(camera.CentreInWorld().norm(), 3);
}

TEST(Rigid3, ComposesAndInverts) {
  const Rigid3 a{Eigen::Quaterniond::UnitRandom(), Eigen::Vector3d::Random()};
  const Rigid3 b{Eigen::Quaterniond::UnitRandom(), Eigen::Vector3d::Random()};
  const Eigen::Vector3d x = Eigen::Vector3d::Random();
  EXPECT_LT(((a * b) * x - a * (b * x)).norm(), 1e-14);
  EXPECT_LT((a.Inverse() * (a * x) - x).norm(), 1e-14);
  const Rigid3 quarter{Eigen::Quaterniond(std::sqrt(0.5), 0, 0, std::sqrt(0.5)), Eigen::Vector3d(10, 0, 0)};
  EXPECT_LT((quarter * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(10, 1, 0)).norm(), 1e-14);
}

TEST(PixelJacobianAt, MatchesDifferences) {
  Eigen::VectorXd x(3 + kNumIntrinsics);
  x << 0.1, -0.2, 0.6, 3250, 3100, 810, 615, -0.08, 0.05, 2e-3, -3e-3, 0.01;
  const PixelJacobian by = PixelJacobianAt(x.data() + 3, x.head<3>());
  Eigen::MatrixXd jacobian(2, x.size());
  jacobian << by.point_in_cam, by.intrinsics;
  testing_support::ExpectJacobianNear(
      [](const Eigen::VectorXd& at) -> Eigen::VectorXd {
        return PixelFromPointInCam<double>(at.data() + 3, Eigen::Vector3d(at.head<3>()));
      },
      x, jacobian, 1e-8, 1e-6);
}

}  // namespace
}  // namespace sole
