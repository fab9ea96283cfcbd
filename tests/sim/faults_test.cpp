// Faults that show in the images, on small ones of a sphere over the glass.
#include "sim/faults.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "core/camera.h"
#include "tests/sim/test_bodies.h"

namespace sole::sim {
namespace {

class ImageFaults : public testing::Test {
 protected:
  ImageFaults() {
    scene_.meshes.push_back(MakeSphere({0, 0, 0.05}, 0.05, 60));
    scene_.dust = false;
  }

  /// Camera `camera` at trigger `trigger`.
  ImageU8 Render(const std::vector<FaultConfig>& faults, int camera, double noise = 0,
                 std::int64_t trigger = 1, std::uint64_t seed = 1) const {
    const std::vector<FaultConfig> active = ImageFaultsAt(faults, trigger);
    const RenderOptions options{.noise = noise, .seed = 3};
    const Renderer renderer(config_, ApplyFaults(rig_, active), ApplyFaults(options, active));
    return renderer.Render(renderer.Prepare(scene_), camera, seed);
  }
  std::string Serial(int camera) const {
    return config_.cameras[static_cast<std::size_t>(camera)].serial;
  }

  RigConfig config_ = MakeDefaultRig(4, 200, 150);
  TrueRig rig_ = DrawTrueRig(config_, 3);
  Scene scene_;
};

double Mean(const ImageU8& image) {
  return std::accumulate(image.pixels.begin(), image.pixels.end(), 0.0) /
         static_cast<double>(image.pixels.size());
}

double StandardDeviation(const ImageU8& image) {
  const double mean = Mean(image);
  double sum = 0;
  for (const std::uint8_t value : image.pixels) sum += (value - mean) * (value - mean);
  return std::sqrt(sum / static_cast<double>(image.pixels.size()));
}

double MeanDifference(const ImageU8& a, const ImageU8& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) sum += std::abs(a.pixels[i] - b.pixels[i]);
  return sum / static_cast<double>(a.pixels.size());
}

/// Root mean square of differences between neighbours: the dots' contrast.
double Sharpness(const ImageU8& image) {
  double sum = 0;
  for (std::size_t i = 1; i < image.pixels.size(); ++i) {
    const double step = image.pixels[i] - image.pixels[i - 1];
    sum += step * step;
  }
  return std::sqrt(sum / static_cast<double>(image.pixels.size()));
}

TEST_F(ImageFaults, HotPixelsStayWhereTheyAreAndSparOtherCameras) {
  const std::vector<FaultConfig> faults = {MakeFault("hot-pixels", Serial(1), 0.002)};
  const ImageU8 good = Render({}, 1, 1), first = Render(faults, 1, 1),
                second = Render(faults, 1, 1, 1, 2);
  int hot = 0;
  for (std::size_t i = 0; i < first.pixels.size(); ++i) {
    if (first.pixels[i] == good.pixels[i]) continue;
    ++hot;
    EXPECT_EQ(first.pixels[i], 255);
    EXPECT_EQ(second.pixels[i], 255) << "stuck, not noise";
  }
  EXPECT_NEAR(hot, 60, 3);
  EXPECT_EQ(Render(faults, 0, 1).pixels, Render({}, 0, 1).pixels);
}

TEST_F(ImageFaults, FogTakesContrastButNotLight) {
  const ImageU8 good = Render({}, 0), fogged = Render({MakeFault("fog", Serial(0), 0.6)}, 0);
  EXPECT_NEAR(Sharpness(fogged) / Sharpness(good), 0.4, 0.08);
  EXPECT_LT(StandardDeviation(fogged), 0.75 * StandardDeviation(good));
  EXPECT_NEAR(Mean(fogged) / Mean(good), 1, 0.05);
}

TEST_F(ImageFaults, BumpedCameraStandsElsewhereByTheAmount) {
  const auto apply = [&](const FaultConfig& fault) { return ApplyFaults(rig_, {fault}); };
  for (int c = 0; c < 4; ++c) {
    const auto index = static_cast<std::size_t>(c);
    const TrueCamera& before = rig_.cameras[index];
    const TrueCamera shifted = apply(MakeFault("bumped-camera", Serial(c))).cameras[index];
    EXPECT_NEAR((shifted.Centre() - before.Centre()).norm(), 0.001, 1e-12);
    EXPECT_NEAR(shifted.cam_from_world.rotation.angularDistance(before.cam_from_world.rotation), 0,
                1e-12);
    const TrueCamera turned =
        apply(MakeFault("bumped-camera", Serial(c), 0.2, "deg")).cameras[index];
    EXPECT_NEAR((turned.Centre() - before.Centre()).norm(), 0, 1e-12);
    EXPECT_NEAR(turned.cam_from_world.rotation.angularDistance(before.cam_from_world.rotation) *
                    180 / 3.14159265358979,
                0.2, 1e-9);
    const TrueCamera other = apply(MakeFault("bumped-camera", Serial((c + 1) % 4))).cameras[index];
    EXPECT_EQ(other.Centre(), before.Centre());
  }
}

TEST_F(ImageFaults, BumpedCameraSeesTheSceneShiftedByWhatItsMoveMakes) {
  // A turn of 2 degrees moves every point of a far scene by about f tan(2 deg).
  const FaultConfig fault = MakeFault("bumped-camera", Serial(0), 2, "deg");
  const ImageU8 good = Render({}, 0), moved = Render({fault}, 0);
  const TrueCamera& before = rig_.cameras[0];
  const TrueCamera after = ApplyFaults(rig_, {fault}).cameras[0];
  const Eigen::Quaterniond turn =
      after.cam_from_world.rotation * before.cam_from_world.rotation.conjugate();
  const Eigen::Vector3d axis = turn * Eigen::Vector3d::UnitZ();
  const int dx = static_cast<int>(std::lround(before.fx * axis.x() / axis.z())),
            dy = static_cast<int>(std::lround(before.fy * axis.y() / axis.z()));
  EXPECT_NEAR(std::hypot(dx, dy), before.fx * std::tan(2 * 3.14159265 / 180), 1);
  const auto difference = [&](int x0, int y0) {
    double sum = 0;
    for (int y = 30; y < 120; ++y) {
      for (int x = 40; x < 160; ++x) sum += std::abs(moved.At(x + x0, y + y0) - good.At(x, y));
    }
    return sum;
  };
  EXPECT_LT(difference(dx, dy), 0.5 * difference(0, 0));
  EXPECT_LT(difference(dx, dy), 0.5 * difference(-dx, -dy));
}

TEST_F(ImageFaults, ProjectorOffTakesItsLightOnly) {
  // Light adds up: what projector 1 alone gives is what is missing without it.
  const std::size_t projectors = config_.simulation.projectors.size();
  ASSERT_GE(projectors, 2U);
  std::vector<FaultConfig> all_but_first, all;
  for (std::size_t i = 1; i <= projectors; ++i) {
    all.push_back(MakeFault("projector-off", "", static_cast<double>(i)));
    if (i > 1) all_but_first.push_back(all.back());
  }
  for (const int camera : {0, 2}) {
    const double lit = Mean(Render({}, camera)), without = Mean(Render({all[0]}, camera)),
                 alone = Mean(Render(all_but_first, camera)), dark = Mean(Render(all, camera));
    EXPECT_NEAR(lit - without, alone - dark, 0.15) << "camera " << camera;
    EXPECT_LT(dark, without + 1e-9);
    EXPECT_LT(dark, 0.5 * lit);
  }
  EXPECT_GT(MeanDifference(Render({}, 0), Render({all[0]}, 0)) +
                MeanDifference(Render({}, 2), Render({all[0]}, 2)),
            1);
}

TEST_F(ImageFaults, LightsOnRaiseTheImageAndDrownTheDots) {
  const ImageU8 good = Render({}, 0), lit = Render({MakeFault("lights-on", "", 1.6)}, 0);
  EXPECT_GT(Mean(lit), Mean(good) + 15);
  const auto contrast = [](const ImageU8& image) { return Sharpness(image) / Mean(image); };
  EXPECT_LT(contrast(lit), 0.75 * contrast(good));
  for (std::size_t i = 0; i < good.pixels.size(); ++i) ASSERT_GE(lit.pixels[i], good.pixels[i]);
}

TEST_F(ImageFaults, BeginAtTheirTrigger) {
  const std::vector<FaultConfig> faults = {MakeFault("fog", "", 0.6, "", 4),
                                           MakeFault("lost-packets")};
  EXPECT_TRUE(ImageFaultsAt(faults, 3).empty());
  ASSERT_EQ(ImageFaultsAt(faults, 4).size(), 1U);
  EXPECT_EQ(ImageFaultsAt(faults, 99)[0].name, "fog");
  EXPECT_EQ(Render(faults, 0, 1, 3).pixels, Render({}, 0, 1).pixels);
}

}  // namespace
}  // namespace sole::sim
