#include "recon/texture.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "core/plate.h"

namespace sole::recon {
namespace {

/// Two cameras below the plate, looking up, 0.1 m apart.
Rig MakeRig() {
  Rig rig;
  for (int i = 0; i < 2; ++i) {
    Camera camera{i == 0 ? "L" : "R", 640, 480, Intrinsics::Zero(), {}};
    camera.intrinsics.head<4>() << 800, 800, 320, 240;
    camera.cam_from_world.translation = {i == 0 ? 0.05 : -0.05, 0, 0.6};
    rig.cameras.push_back(camera);
  }
  rig.pairs.push_back({"below", 0, 1});
  return rig;
}

/// Grey levels that grow with x in the left image and with y in the right one.
FrameSet MakeTexture() {
  FrameSet frame;
  frame.trigger = 2;
  frame.kind = ExposureKind::kTexture;
  for (int camera = 0; camera < 2; ++camera) {
    ImageU8 image(640, 480);
    for (int y = 0; y < 480; ++y) {
      for (int x = 0; x < 640; ++x)
        image.At(x, y) = static_cast<std::uint8_t>(camera == 0 ? x / 3 : y / 2);
    }
    frame.images.emplace_back(std::move(image));
  }
  return frame;
}

PointCloud MakeCloud() {
  PointCloud cloud;
  for (const Eigen::Vector3f& p :
       {Eigen::Vector3f(0, 0, 0.01F), {0.03F, -0.05F, 0}, {-0.02F, 0.08F, 0.03F}, {5, 0, 0.01F}}) {
    cloud.points_m.push_back(p);
    cloud.intensity.push_back(7);
    cloud.pair.push_back(0);
  }
  return cloud;
}

TEST(TextureIntensity, IsThatOfTheImagesWhereRefractedRaysMeetThem) {
  const Rig rig = MakeRig();
  const PointCloud cloud = MakeCloud();
  FrameSet texture = MakeTexture();
  std::vector<float> grey = TextureIntensity(cloud, rig, texture);
  ASSERT_EQ(grey.size(), 4U);
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector2d px =
        PixelFromWorld(rig.cameras[0], rig.plate, cloud.points_m[i].cast<double>());
    EXPECT_NEAR(grey[i], px.x() / 3 - 1.0 / 3, 0.4) << i;
  }
  EXPECT_EQ(grey[3], 7) << "outside of both images";
  texture.images[0].reset();
  grey = TextureIntensity(cloud, rig, texture);
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector2d px =
        PixelFromWorld(rig.cameras[1], rig.plate, cloud.points_m[i].cast<double>());
    EXPECT_NEAR(grey[i], px.y() / 2 - 0.25, 0.3) << i;
  }
  texture.images[1].reset();
  EXPECT_EQ(TextureIntensity(cloud, rig, texture), cloud.intensity);
}

TEST(TextureIntensity, RefusesSpeckleAndOtherRigs) {
  const Rig rig = MakeRig();
  FrameSet texture = MakeTexture();
  texture.kind = ExposureKind::kSpeckle;
  EXPECT_THROW(TextureIntensity(MakeCloud(), rig, texture), Error);
  texture = MakeTexture();
  texture.images.pop_back();
  EXPECT_THROW(TextureIntensity(MakeCloud(), rig, texture), Error);
  PointCloud nameless = MakeCloud();
  nameless.pair.clear();
  EXPECT_THROW(TextureIntensity(nameless, rig, MakeTexture()), Error);
}

}  // namespace
}  // namespace sole::recon
