#include "sim/light_path.h"

#include <cmath>
#include <numbers>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

namespace sole::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180;

TrueCamera WideCamera() {
  TrueCamera camera;
  camera.width = 1624;
  camera.height = 1236;
  camera.fx = 3260;
  camera.fy = 3255;
  camera.cx = 820;
  camera.cy = 610;
  camera.k1 = -0.09;
  camera.k2 = 0.03;
  camera.p1 = 3e-4;
  camera.p2 = -2e-4;
  camera.cam_from_world =
      Rigid3{Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Vector3d(1, 2, 0.5).normalized())),
             Vector3d(0.02, -0.01, 0.66)};
  return camera;
}

TEST(CrossPlate, LandsWhereTheParallelPlateFormulaSays) {
  const TruePlate plate{10, 10, 0.0152, 1.518};
  for (const bool upwards : {true, false}) {
    for (int degrees = 0; degrees <= 60; degrees += 5) {
      const double a = degrees * kDegree, azimuth = 0.7 + degrees;
      const Vector3d lateral(std::cos(azimuth), std::sin(azimuth), 0);
      const Vector3d along = upwards ? Vector3d(0, 0, 1) : Vector3d(0, 0, -1);
      const Vector3d direction = std::cos(a) * along + std::sin(a) * lateral;
      const Vector3d start = (upwards ? -0.6 : 0.5) * Vector3d::UnitZ() + Vector3d(0.01, -0.02, 0);
      const PlateCrossing crossing = CrossPlate(plate, {start, direction});
      ASSERT_EQ(crossing.kind, PlateCrossing::Kind::kThrough);
      EXPECT_LT((crossing.direction - direction).norm(), 1e-14);
      // Behind the plate the ray runs as if everything there were nearer by s along the normal.
      const double s =
          plate.thickness_m *
          (1 - std::cos(a) / std::sqrt(plate.index * plate.index - std::sin(a) * std::sin(a)));
      const double height = upwards ? 0.05 : -0.30;
      const Vector3d found =
          crossing.far_point + (height - crossing.far_point.z()) / direction.z() * direction;
      const Vector3d moved = start + s * along;
      const Vector3d expected = moved + (height - moved.z()) / direction.z() * direction;
      EXPECT_LT((found - expected).norm(), 1e-9) << degrees << " degrees";
    }
  }
}

TEST(CrossPlate, RaysBesideThePlateStayInAir) {
  const TruePlate plate{0.4, 0.5, 0.015, 1.52};
  const auto kind = [&](const Vector3d& from, const Vector3d& through) {
    return CrossPlate(plate, {from, (through - from).normalized()}).kind;
  };
  EXPECT_EQ(kind({0, 0, -0.6}, {0.21, 0, -0.015}), PlateCrossing::Kind::kMisses);
  EXPECT_EQ(kind({0, 0, -0.6}, {0, 0.19, -0.015}), PlateCrossing::Kind::kThrough);
  // Enters by a face and leaves by the side, and the other way round.
  EXPECT_EQ(kind({0, 0, -0.6}, {0.1999, 0, -0.015}), PlateCrossing::Kind::kEdge);
  EXPECT_EQ(kind({0.9, 0, -0.6}, {0.205, 0, -0.015}), PlateCrossing::Kind::kEdge);
  // Light that leads away from the plate never meets it.
  EXPECT_EQ(kind({0, 0, 0.3}, {0, 0, 0.4}), PlateCrossing::Kind::kMisses);
}

TEST(CrossPlate, LosesWhatFresnelSays) {
  const TruePlate plate{0.4, 0.5, 0.015, 1.52};
  const PlateCrossing crossing = CrossPlate(plate, {Vector3d(0, 0, -0.5), Vector3d::UnitZ()});
  const double reflected = std::pow((1.52 - 1) / (1.52 + 1), 2);
  EXPECT_NEAR(crossing.near_transmittance, 1 - reflected, 1e-12);
  EXPECT_NEAR(crossing.far_transmittance, 1 - reflected, 1e-12);
  EXPECT_NEAR(FresnelReflectance(std::cos(std::atan(1.52)), 1.52),
              0.5 * std::pow(std::sin(std::atan(1.52) - std::atan(1 / 1.52)), 2),
              1e-12);  // Brewster's angle
}

TEST(PathBetween, MeetsItsEndAfterRefraction) {
  const TruePlate plate{2, 2, 0.0149, 1.522};
  std::mt19937_64 engine(1);
  std::uniform_real_distribution<double> unit(-1, 1);
  for (int i = 0; i < 200; ++i) {
    const Vector3d below(0.4 * unit(engine), 0.4 * unit(engine), -0.4 + 0.3 * unit(engine));
    const Vector3d above(0.4 * unit(engine), 0.4 * unit(engine),
                         i % 5 == 0 ? 0.0 : 0.2 + 0.2 * unit(engine));
    for (const bool up : {true, false}) {
      const LightPath path =
          up ? PathBetween(plate, below, above) : PathBetween(plate, above, below);
      const Vector3d from = up ? below : above, to = up ? above : below;
      const PlateCrossing crossing = CrossPlate(plate, {from, path.leaving});
      ASSERT_EQ(crossing.kind, PlateCrossing::Kind::kThrough);
      const Vector3d rest = to - crossing.far_point;
      EXPECT_LT((rest - rest.dot(crossing.direction) * crossing.direction).norm(), 1e-12);
      EXPECT_TRUE(path.clear);
    }
  }
}

TEST(PathBetween, TopOfSaggedGlassIsTheUnloadedTopSeenByACameraRaisedByTheSag) {
  const TruePlate plate;
  const Vector3d below(0.1, -0.05, -0.35), down(0, 0, 0.0003), point(-0.04, 0.06, 0);
  const LightPath sagged = PathBetween(plate, below, point - down), raised = PathBetween(plate, below + down, point);
  EXPECT_LT((sagged.leaving - raised.leaving).norm(), 1e-12);
  EXPECT_LT((PathBetween(plate, Vector3d(0.1, 0, 0.4), point - down).leaving -
             (point - down - Vector3d(0.1, 0, 0.4)).normalized()).norm(), 1e-15);
}

TEST(PathBetween, IsStraightOnOneSide) {
  const TruePlate plate;
  const Vector3d from(0.3, 0.1, 0.5), to(0, 0, 0);
  const LightPath path = PathBetween(plate, from, to);
  EXPECT_LT((path.leaving - (to - from).normalized()).norm(), 1e-15);
  EXPECT_EQ(path.transmittance, 1);
}

TEST(RayOfPixel, IsInvertedByProjection) {
  const TrueCamera camera = WideCamera();
  for (double x = -20; x < 1660; x += 93) {
    for (double y = -20; y < 1260; y += 71) {
      const LightRay ray = RayOfPixel(camera, {x, y});
      const auto pixel = PixelOfDirection(camera, ray.direction);
      ASSERT_TRUE(pixel.has_value());
      EXPECT_LT((*pixel - Vector2d(x, y)).norm(), 1e-9);
    }
  }
  EXPECT_FALSE(
      PixelOfDirection(camera, camera.cam_from_world.Inverse().rotation * Vector3d(0, 0, -1)));
}

}  // namespace
}  // namespace sole::sim
