// Lamps flash for the exposure that they are made for; the room's light burns all the time.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "sim/renderer.h"
#include "sim/sensor.h"

namespace sole::sim {
namespace {

struct Light {
  double mean = 0, brightest = 0;  ///< grey levels above black
};

/// The calibration cube in the middle of the volume as a camera beside it sees it.
Light See(double exposure_us, double room, bool lamps) {
  RigConfig config = MakeDefaultRig(4, 200, 150);
  for (CameraConfig& camera : config.cameras) camera.exposure_us = exposure_us;
  RenderOptions options{.noise = 0, .ambient_light = room};
  for (int i = 0; !lamps && i < static_cast<int>(config.simulation.projectors.size()); ++i)
    options.dark_projectors.push_back(i);
  TrueRig rig = DrawTrueRig(config, 5);
  for (TrueCamera& camera : rig.cameras) camera.vignetting = 0;
  const Renderer renderer(config, rig, options);
  Scene scene;
  scene.world_from_target =
      Rigid3{Eigen::Quaterniond::Identity(), Eigen::Vector3d(0, 0, 0.08)};
  const ImageU8 image = renderer.Render(renderer.Prepare(scene), 2, 1);
  Light light;
  for (const std::uint8_t level : image.pixels) {
    light.mean += (level - kBlackLevel) / static_cast<double>(image.pixels.size());
    light.brightest = std::max(light.brightest, level - kBlackLevel);
  }
  return light;
}

TEST(Exposure, RoomLightCountsByTimeAndNotByTheLampsFlash) {
  const Light room = See(4000, 0.4, false);
  EXPECT_GT(room.brightest, 0.5 * 0.4 * 255) << "white paper in 4 ms";
  EXPECT_LT(room.brightest, 1.1 * 0.4 * 255);
  EXPECT_NEAR(See(1000, 1.6, false).mean, room.mean, 0.6) << "a quarter of the time";
  EXPECT_NEAR(See(1000, 0.4, false).mean, 0.25 * room.mean, 0.6);
}

TEST(Exposure, TheDefaultFlashFillsTheImageAndLessOfItGivesLess) {
  const double whole = See(CameraConfig{}.exposure_us, 0, true).mean,
               half = See(0.5 * CameraConfig{}.exposure_us, 0, true).mean;
  EXPECT_GT(See(CameraConfig{}.exposure_us, 0, true).brightest, 120);
  EXPECT_NEAR(half, 0.5 * whole, 0.05 * whole + 0.3);
}

}  // namespace
}  // namespace sole::sim
