#include "recon/grid_match.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/recon/rectified_scene.h"

namespace sole::recon {
namespace {

using testing_support::SlantedPlane;
using testing_support::MakeRectifiedScene;
using testing_support::RectifiedScene;

/// Dots smeared over 21 pixels along rows right of a column, as where a foot comes down, and noise.
ImageF Smear(const ImageF& sharp, int from, unsigned seed) {
  std::mt19937 engine(seed);
  std::normal_distribution<float> noise(0, 6.0F);
  ImageF image = sharp;
  constexpr int kReach = 10;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      if (x >= from && x + kReach < image.width) {
        float sum = 0;
        for (int k = -kReach; k <= kReach; ++k) sum += sharp.At(x + k, y);
        image.At(x, y) = sum / (2 * kReach + 1);
      }
      image.At(x, y) += noise(engine);
    }
  }
  return image;
}

struct Found {
  int smeared = 0, sharp = 0;  ///< matches
  double normalized = 0;       ///< RMS of errors over what the covariance says, smeared part
};

Found Match(const RectifiedScene& scene, int wide_radius_px) {
  const int left_from = 200;
  const PreparedImage left = Prepare(Smear(scene.left_grey, left_from, 1)),
                      right = Prepare(Smear(scene.right_grey, left_from - 30, 2));
  const ImageU8 mask(scene.left_grey.width, scene.left_grey.height, 255);
  GridOptions options;
  options.wide_radius_px = wide_radius_px;
  const GridMatches grid = MatchOnGrid(left, right, mask,
                                       StartsFromDisparity(scene.disparity, 4), options);
  Found found;
  for (const PixelMatch& m : grid.matches) {
    const auto truth = static_cast<double>(scene.disparity.At(m.left_px.x(), m.left_px.y()));
    if (m.left_px.x() < left_from) ++found.sharp;
    if (m.left_px.x() < left_from + 40 || m.left_px.x() > scene.left_grey.width - 40) continue;
    ++found.smeared;
    const double error = m.left_px.x() - m.match.warp.position_px.x() - truth;
    found.normalized += error * error / m.match.covariance_px2(0, 0);
  }
  found.normalized = std::sqrt(found.normalized / found.smeared);
  return found;
}

TEST(MatchOnGrid, WiderWindowsFindSmearedDots) {
  const RectifiedScene scene =
      MakeRectifiedScene(SlantedPlane(0, 0.05, 0.05, 0.2, 0.2), {.noise = 0});
  const Found narrow = Match(scene, 0), wide = Match(scene, 10);
  EXPECT_GT(wide.smeared, 1.15 * narrow.smeared);
  EXPECT_GT(wide.normalized, 0.4);
  EXPECT_LT(wide.normalized, 1.8);
  EXPECT_NEAR(wide.sharp, narrow.sharp, 0.02 * narrow.sharp);
}

}  // namespace
}  // namespace sole::recon
