#include "calib/edge_fit.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace sole::calib {
namespace {

/// Picture of a black-white plane pattern: 10 x 10 samples over two pixels, noise, 8 bits.
ImageU8 Draw(int width, int height, const std::function<bool(double, double)>& white, double noise,
             std::uint64_t seed, double low = 40, double high = 200) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  ImageU8 image(width, height);
  constexpr int kSamples = 10;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      int count = 0;
      for (int j = 0; j < kSamples; ++j) {
        for (int i = 0; i < kSamples; ++i) {
          // A footprint two pixels wide stands for lens blur.
          count += white(x - 1 + (i + 0.5) * 2 / kSamples, y - 1 + (j + 0.5) * 2 / kSamples);
        }
      }
      const double value =
          low + (high - low) * count / (kSamples * kSamples) + 0.3 * x + noise * normal(random);
      image.At(x, y) = static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
    }
  }
  return image;
}

struct Slanted {
  Eigen::Vector2d centre, along_x, along_y;
  Eigen::Vector2d Board(double x, double y) const {
    Eigen::Matrix2d m;
    m << along_x, along_y;
    return m.inverse() * (Eigen::Vector2d(x, y) - centre);
  }
};

Slanted RandomSlant(std::mt19937_64& random) {
  std::uniform_real_distribution<double> uniform(0, 1);
  const double angle = 2 * std::numbers::pi * uniform(random), skew = 1.0 + uniform(random);
  return {{20 + uniform(random), 20 + uniform(random)},
          40 * Eigen::Vector2d(std::cos(angle), std::sin(angle)),
          (20 + 20 * uniform(random)) *
              Eigen::Vector2d(std::cos(angle + skew), std::sin(angle + skew))};
}

TEST(FitSaddle, FindsSlantedCornersAtEverySubpixelPlace) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  double squares = 0, normalised = 0;
  constexpr int kTrials = 40;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Slanted slant = RandomSlant(random);
    const ImageU8 image = Draw(
        41, 41,
        [&](double x, double y) {
          const auto b = slant.Board(x, y);
          return b.x() * b.y() > 0;
        },
        2, 50);
    SaddleGuess guess{
        slant.centre + Eigen::Vector2d(normal(random), normal(random)).cwiseMax(-1.5).cwiseMin(1.5),
        slant.along_x, slant.along_y, 0.3, true};
    const auto point = FitSaddle(image, guess, 8);
    ASSERT_TRUE(point) << trial;
    const double error = (point->pixel - slant.centre).squaredNorm() / 2;
    squares += error;
    normalised += error / (point->sigma_px * point->sigma_px);
  }
  EXPECT_LT(std::sqrt(squares / kTrials), 0.03);
  EXPECT_LT(std::sqrt(normalised / kTrials), 2.0);
  EXPECT_GT(std::sqrt(normalised / kTrials), 0.5);
}

TEST(FitSaddle, SaturationDoesNotMoveIt) {
  const Slanted slant{{20.3, 20.7}, {35, 10}, {-8, 30}};
  const ImageU8 image = Draw(
      41, 41,
      [&](double x, double y) {
        const auto b = slant.Board(x, y);
        return b.x() * b.y() > 0;
      },
      0, 1, 20, 400);
  const auto point = FitSaddle(image, {{20, 21}, slant.along_x, slant.along_y, 0.3, true}, 8);
  ASSERT_TRUE(point);
  EXPECT_LT((point->pixel - slant.centre).norm(), 0.03);
}

TEST(FitSaddle, RefusesWrongSignEdgesAndFlatPictures) {
  const Slanted slant{{20.3, 20.7}, {35, 10}, {-8, 30}};
  const ImageU8 saddle = Draw(
      41, 41,
      [&](double x, double y) {
        const auto b = slant.Board(x, y);
        return b.x() * b.y() > 0;
      },
      1, 1);
  EXPECT_FALSE(FitSaddle(saddle, {{20, 21}, slant.along_x, slant.along_y, 0.3, false}, 8));
  const ImageU8 edge = Draw(
      41, 41, [&](double x, double y) { return slant.Board(x, y).x() > 0; }, 1, 1);
  EXPECT_FALSE(FitSaddle(edge, {{20, 21}, slant.along_x, slant.along_y, 0.3, true}, 8));
  EXPECT_FALSE(
      FitSaddle(ImageU8(41, 41, 90), {{20, 21}, slant.along_x, slant.along_y, 0.3, true}, 8));
  EXPECT_FALSE(FitSaddle(saddle, {{3, 21}, slant.along_x, slant.along_y, 0.3, true}, 8));
}

TEST(FitSquare, IntersectsTheEdges) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1, 1);
  double squares = 0;
  constexpr int kTrials = 20;
  for (int trial = 0; trial < kTrials; ++trial) {
    const Slanted slant{{35 + uniform(random), 35 + uniform(random)},
                        {20 + uniform(random), 3 * uniform(random)},
                        {8 * uniform(random), -22 + uniform(random)}};
    const ImageU8 image = Draw(
        71, 71, [&](double x, double y) { return slant.Board(x, y).cwiseAbs().maxCoeff() > 1; }, 2,
        60);
    std::array<Eigen::Vector2d, 4> corners, guess;
    const double sign[4][2] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (std::size_t i = 0; i < 4; ++i) {
      corners[i] = slant.centre + sign[i][0] * slant.along_x + sign[i][1] * slant.along_y;
      guess[i] = corners[i] + 0.7 * Eigen::Vector2d(uniform(random), uniform(random));
    }
    const auto fitted = FitSquare(image, guess, 2.5);
    ASSERT_TRUE(fitted) << trial;
    for (std::size_t i = 0; i < 4; ++i)
      squares += ((*fitted)[i].pixel - corners[i]).squaredNorm() / 2;
  }
  EXPECT_LT(std::sqrt(squares / (4 * kTrials)), 0.03);
  EXPECT_FALSE(FitSquare(ImageU8(71, 71, 90), {{{10, 10}, {50, 10}, {50, 50}, {10, 50}}}, 2.5));
}

}  // namespace
}  // namespace sole::calib
