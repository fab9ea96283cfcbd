#include "recon/triangulate.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/recon/speckle_scene.h"

namespace sole::recon {
namespace {

using testing_support::NominalRig;
using testing_support::SlantedPlane;

struct Scene {
  Rig rig = NominalRig(MakeDefaultRig(4, 812, 618));
  ImageU8 image{812, 618, 77};
};

/// Exact matches of a surface seen by a pair, with truth from Snell's law at each face.
std::vector<PixelMatch> ExactMatches(const Rig& rig, int pair,
                                     const testing_support::Surface& surface,
                                     std::vector<Eigen::Vector3d>* truth) {
  const StereoPair& names = rig.pairs[static_cast<std::size_t>(pair)];
  const Camera& left = rig.cameras[static_cast<std::size_t>(names.left)];
  const Camera& right = rig.cameras[static_cast<std::size_t>(names.right)];
  std::vector<PixelMatch> matches;
  for (int y = 20; y < left.height; y += 40) {
    for (int x = 20; x < left.width; x += 40) {
      Eigen::Vector3d origin, direction;
      testing_support::TracePixel(left, rig.plate, x, y, origin, direction);
      const auto t = surface.hit(origin, direction);
      if (!t) continue;
      PixelMatch match;
      match.left_px = {x, y};
      truth->push_back(origin + *t * direction);
      match.match.warp.position_px = PixelFromWorld(right, rig.plate, truth->back());
      match.match.covariance_px2 = 1e-4 * Eigen::Matrix2d::Identity();
      matches.push_back(match);
    }
  }
  return matches;
}

TEST(Triangulate, ExactThroughTheGlassAndInAir) {
  const Scene scene;
  for (const int pair : {0, 1}) {
    std::vector<Eigen::Vector3d> truth;
    const auto matches =
        ExactMatches(scene.rig, pair, SlantedPlane(0.03, 0.1, -0.05, 0.08, 0.15), &truth);
    const Triangulation result = Triangulate(scene.rig, pair, matches, scene.image);
    ASSERT_GT(matches.size(), 60U);
    ASSERT_EQ(result.points.size(), matches.size());
    EXPECT_NEAR(result.median_gap_px, 0, 1e-6);
    for (std::size_t i = 0; i < truth.size(); ++i) {
      EXPECT_LT((result.points[i].point_m - truth[i]).norm(), 1e-8);
      EXPECT_EQ(result.points[i].intensity, 77);
    }
  }
}

TEST(Triangulate, SigmaEqualsMonteCarlo) {
  const Scene scene;
  std::mt19937_64 engine(3);
  std::normal_distribution<double> normal(0, 1);
  for (const int pair : {0, 1}) {
    std::vector<Eigen::Vector3d> truth;
    auto matches =
        ExactMatches(scene.rig, pair, SlantedPlane(0.03, 0.1, -0.05, 0.08, 0.15), &truth);
    double squares = 0, variance = 0;
    int count = 0;
    for (int round = 0; round < 20; ++round) {
      auto noisy = matches;
      for (PixelMatch& m : noisy)
        m.match.warp.position_px += 0.02 * Eigen::Vector2d(normal(engine), normal(engine));
      for (PixelMatch& m : noisy) m.match.covariance_px2 = 4e-4 * Eigen::Matrix2d::Identity();
      const Triangulation result =
          Triangulate(scene.rig, pair, noisy, scene.image, {.floor_px = 0});
      ASSERT_EQ(result.points.size(), truth.size());
      for (std::size_t i = 0; i < truth.size(); ++i) {
        const PairPoint& p = result.points[i];
        squares += std::pow((p.point_m - truth[i]).dot(p.to_camera), 2);
        variance += p.ray_sigma_m * p.ray_sigma_m;
        ++count;
      }
    }
    EXPECT_NEAR(std::sqrt(squares / variance), 1, 0.08) << count;
  }
}

TEST(Triangulate, VerticalMismatchIsRejected) {
  const Scene scene;
  std::vector<Eigen::Vector3d> truth;
  auto matches = ExactMatches(scene.rig, 0, SlantedPlane(0.02, 0, 0, 0.08, 0.15), &truth);
  // The lower pair's baseline lies along image x.
  matches[5].match.warp.position_px.y() += 1.0;
  matches[9].match.warp.position_px.y() -= 3.0;
  const Triangulation result = Triangulate(scene.rig, 0, matches, scene.image);
  EXPECT_EQ(result.bad_gap, 2);
  EXPECT_EQ(result.points.size(), matches.size() - 2);
}

TEST(Triangulate, DriftedCalibrationShowsInTheMedianGap) {
  const Scene scene;
  std::vector<Eigen::Vector3d> truth;
  auto matches = ExactMatches(scene.rig, 0, SlantedPlane(0.02, 0, 0, 0.08, 0.15), &truth);
  for (PixelMatch& m : matches) m.match.warp.position_px.y() += 0.6;
  const Triangulation result = Triangulate(scene.rig, 0, matches, scene.image);
  EXPECT_NEAR(std::abs(result.median_gap_px), 0.6, 0.02);
  EXPECT_EQ(result.points.size(), matches.size());
}

TEST(Triangulate, MirrorImagesAndFarPointsAreOutside) {
  const Scene scene;
  // Above the glass a camera sees the foot's mirror image below z = 0.
  std::vector<Eigen::Vector3d> truth;
  auto matches = ExactMatches(scene.rig, 1, SlantedPlane(0.04, 0, 0, 0.05, 0.10), &truth);
  const Camera& right = scene.rig.cameras[3];
  const std::size_t count = matches.size();
  for (std::size_t i = 0; i < count; ++i) {
    const Camera& left = scene.rig.cameras[2];
    const Ray ray = RayFromPixel(left, scene.rig.plate, matches[i].left_px.cast<double>());
    const double depth = i % 2 == 0 ? (-0.004 - ray.origin.z()) / ray.direction.z() : 0.2;
    const Eigen::Vector3d in_cam =
        right.cam_from_world * Eigen::Vector3d(ray.origin + depth * ray.direction);
    matches[i].match.warp.position_px =
        PixelFromPointInCam<double>(right.intrinsics.data(), in_cam);
  }
  const Triangulation result = Triangulate(scene.rig, 1, matches, scene.image);
  EXPECT_EQ(result.points.size(), 0U);
  EXPECT_EQ(result.outside, static_cast<int>(count));
}

}  // namespace
}  // namespace sole::recon
