#include "capture/desync.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace sole::capture {
namespace {

using ::testing::ElementsAre;

/// Movement of `cameras` over triggers 2 to 13, each with its own scale; `late` lags by `shift`.
std::vector<std::map<std::int64_t, double>> Curves(std::size_t cameras, std::size_t late, int shift,
                                                   double swing, double noise) {
  std::mt19937 engine(5);
  std::normal_distribution<double> gauss(0, noise);
  std::vector<std::map<std::int64_t, double>> motion(cameras);
  for (std::size_t c = 0; c < cameras; ++c) {
    for (int t = 2; t <= 13; ++t) {
      const double at = t - (c == late ? shift : 0);
      motion[c][t] =
          (1 + 0.5 * static_cast<double>(c)) * (1 + swing * std::sin(1.1 * at)) + gauss(engine);
    }
  }
  return motion;
}

TEST(ImageShifts, CameraThatLagsIsFound) {
  EXPECT_THAT(ImageShifts(Curves(4, 2, 1, 0.5, 0.02)), ElementsAre(0, 0, 1, 0));
  EXPECT_THAT(ImageShifts(Curves(4, 0, 2, 0.5, 0.02)), ElementsAre(2, 0, 0, 0));
  EXPECT_THAT(ImageShifts(Curves(4, 1, -1, 0.5, 0.02)), ElementsAre(0, -1, 0, 0));
}

TEST(ImageShifts, InStepOrStillIsZero) {
  EXPECT_THAT(ImageShifts(Curves(4, 0, 0, 0.5, 0.02)), ElementsAre(0, 0, 0, 0));
  EXPECT_THAT(ImageShifts(Curves(4, 2, 1, 0.0, 0.05)), ElementsAre(0, 0, 0, 0)) << "only noise";
}

TEST(ImageShifts, TwoCamerasCannotTellWhoLags) {
  EXPECT_THAT(ImageShifts(Curves(2, 1, 1, 0.5, 0)), ElementsAre(0, 0));
}

TEST(ImageShifts, MissingFramesAreLeftOut) {
  auto motion = Curves(4, 3, 1, 0.5, 0.01);
  motion[0].erase(6);
  motion[1].erase(9);
  EXPECT_THAT(ImageShifts(motion), ElementsAre(0, 0, 0, 1));
  for (int t = 2; t < 8; ++t) motion[2].erase(t);
  EXPECT_THAT(ImageShifts(motion), ElementsAre(0, 0, 0, 0)) << "too few in common";
}

}  // namespace
}  // namespace sole::capture
