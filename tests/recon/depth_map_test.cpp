#include "recon/depth_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/recon/ellipsoid_cloud.h"
#include "tests/recon/speckle_scene.h"
#include "tests/support/error_matcher.h"

namespace sole::recon {
namespace {

using testing::HasSubstr;

const Eigen::Vector3d kCentre(0.01, 0, 0.05), kRadii(0.04, 0.1, 0.045);

TEST(RenderDepthMap, DepthAndNormalsOfAnEllipsoid) {
  const Rig rig = testing_support::NominalRig(MakeDefaultRig(4, 812, 618));
  const PointCloud cloud = testing_support::EllipsoidCloud(kCentre, kRadii, 0.0012);
  const auto truth = testing_support::Ellipsoid(kCentre, kRadii);
  for (const Camera& camera : rig.cameras) {
    const DepthMap map = RenderDepthMap(cloud, camera, {.spacing_m = 0.0012});
    EXPECT_TRUE(map.camera.intrinsics.tail<5>().isZero());
    int hit = 0, filled = 0, wrong = 0;
    double squares = 0;
    for (int y = 0; y < map.depth_m.height; ++y) {
      for (int x = 0; x < map.depth_m.width; ++x) {
        const Rigid3 world_from_cam = map.camera.cam_from_world.Inverse();
        const Eigen::Vector3d ray(NormalizedFromPixel(map.camera.intrinsics, Eigen::Vector2d(x, y)).homogeneous());
        const auto t = truth.hit(world_from_cam.translation, world_from_cam.rotation * ray);
        const auto depth = static_cast<double>(map.depth_m.At(x, y));
        if (!t) {
          wrong += depth > 0 ? 1 : 0;
          continue;
        }
        const Eigen::Vector3d point = world_from_cam * Eigen::Vector3d(*t * ray);
        const Eigen::Vector3d normal =
            world_from_cam.rotation.conjugate() *
            (point - kCentre).cwiseQuotient(kRadii.cwiseAbs2()).normalized();
        if (-normal.dot(ray.normalized()) < 0.25) continue;  // the rim
        ++hit;
        if (depth == 0) continue;
        ++filled;
        squares += (depth - *t) * (depth - *t);
        const Eigen::Vector3f found = map.normals[static_cast<std::size_t>(y * map.depth_m.width + x)];
        EXPECT_GT(found.dot(normal.cast<float>()), 0.99F);
        EXPECT_GT(map.grey.At(x, y), 10);
      }
    }
    std::printf("%d of %d pixels, rms %.4f mm, %d beyond the rim\n", filled, hit,
                1000 * std::sqrt(squares / filled), wrong);
    EXPECT_GT(hit, 2000);
    EXPECT_GT(filled, 0.98 * hit);
    EXPECT_LT(std::sqrt(squares / filled), 5e-5);
    EXPECT_LT(wrong, 0.05 * hit);
  }
}

TEST(RenderDepthMap, TheFarSideDoesNotShineThrough) {
  const Rig rig = testing_support::NominalRig(MakeDefaultRig(4, 812, 618));
  PointCloud cloud = testing_support::EllipsoidCloud(kCentre, kRadii, 0.0012);
  // A shell inside, whose points also face the camera.
  const PointCloud inner = testing_support::EllipsoidCloud(kCentre, 0.8 * kRadii, 0.0012);
  cloud.points_m.insert(cloud.points_m.end(), inner.points_m.begin(), inner.points_m.end());
  cloud.normals.insert(cloud.normals.end(), inner.normals.begin(), inner.normals.end());
  cloud.sigma_m.resize(cloud.Size(), 1e-5F);
  cloud.intensity.resize(cloud.Size(), 0.0F);
  const PointCloud outer = testing_support::EllipsoidCloud(kCentre, kRadii, 0.0012);
  const DepthMap both = RenderDepthMap(cloud, rig.cameras[0], {.focal_px = 450, .spacing_m = 0.0012});
  const DepthMap alone = RenderDepthMap(outer, rig.cameras[0], {.focal_px = 450, .spacing_m = 0.0012});
  int different = 0, filled = 0;
  for (std::size_t i = 0; i < both.depth_m.pixels.size(); ++i) {
    if (alone.depth_m.pixels[i] == 0) continue;
    ++filled;
    different += both.depth_m.pixels[i] != alone.depth_m.pixels[i] ? 1 : 0;
  }
  EXPECT_GT(filled, 1000);
  EXPECT_LT(different, 0.01 * filled);
}

TEST(RenderDepthMap, NeedsNormals) {
  PointCloud bare;
  bare.points_m = {{0, 0, 0}};
  EXPECT_THAT(testing_support::ErrorOf([&] { RenderDepthMap(bare, Camera{}); }), HasSubstr("normals"));
}

}  // namespace
}  // namespace sole::recon
