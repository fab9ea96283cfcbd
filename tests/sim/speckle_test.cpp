#include "sim/speckle.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

namespace sole::sim {
namespace {

constexpr double kPixel = 1 / 3250.0;  // angle of a camera's pixel

std::vector<double> Row(const SpecklePattern& pattern, double y) {
  std::vector<double> row;
  for (int x = 0; x < 700; ++x)
    row.push_back(static_cast<double>(pattern.At((x - 350) * kPixel, y)));
  return row;
}

/// Correlation of the pattern with itself, moved sideways by whole pixels.
double Correlation(const SpecklePattern& pattern, int shift) {
  double a_sum = 0, aa = 0, ab = 0;
  int count = 0;
  for (int line = 0; line < 100; ++line) {
    const std::vector<double> row = Row(pattern, (line * 7 - 350) * kPixel);
    for (std::size_t x = 0; x + 20 < row.size(); ++x, ++count) {
      a_sum += row[x];
      aa += row[x] * row[x];
      ab += row[x] * row[x + static_cast<std::size_t>(shift)];
    }
  }
  const double mean = a_sum / count;
  return (ab / count - mean * mean) / (aa / count - mean * mean);
}

TEST(SpecklePattern, DotsOfFourPixelsDecorrelateWithinTheirSize) {
  const SpecklePattern pattern(3, 4 * kPixel);
  // Discs of diameter d overlap by half when moved by 0.40 d, and by nothing when moved by d.
  EXPECT_GT(Correlation(pattern, 1), 0.55);
  EXPECT_LT(Correlation(pattern, 2), 0.45);
  EXPECT_LT(std::abs(Correlation(pattern, 6)), 0.15);
  EXPECT_LT(std::abs(Correlation(pattern, 17)), 0.05);
}

TEST(SpecklePattern, SeedsGiveUnrelatedPatternsOfEqualBrightness) {
  const SpecklePattern a(1, 4 * kPixel), b(2, 4 * kPixel), again(1, 4 * kPixel);
  double sum_a = 0, sum_b = 0, product = 0, square = 0;
  int count = 0;
  for (int line = 0; line < 100; ++line) {
    const double y = (line * 5 - 250) * kPixel;
    const std::vector<double> row_a = Row(a, y), row_b = Row(b, y);
    EXPECT_EQ(row_a, Row(again, y));
    for (std::size_t x = 0; x < row_a.size(); ++x, ++count) {
      sum_a += row_a[x];
      sum_b += row_b[x];
      square += row_a[x] * row_a[x];
      product += row_a[x] * row_b[x];
    }
  }
  const double mean = sum_a / count, variance = square / count - mean * mean;
  EXPECT_NEAR(mean, sum_b / count, 0.03);
  EXPECT_GT(mean, 0.25);
  EXPECT_LT(mean, 0.55);
  EXPECT_GT(std::sqrt(variance), 0.25);
  EXPECT_LT(std::abs(product / count - mean * sum_b / count) / variance, 0.03);
}

TEST(SpecklePattern, ScatteredInSkinKeepsItsLightAndMostOfItsContrast) {
  const SpecklePattern sharp(3, 4 * kPixel);
  const double near = 0.9 * kPixel, far_share = 0.12;
  const SpecklePattern soft = sharp.Scattered(near, far_share);
  double mean_sharp = 0, mean_soft = 0, variance_sharp = 0, variance_soft = 0, steps = 0,
         steps_soft = 0, count = 0;
  for (int line = 0; line < 100; ++line) {
    const std::vector<double> a = Row(sharp, line * 5 * kPixel), b = Row(soft, line * 5 * kPixel);
    for (std::size_t x = 1; x < a.size(); ++x, ++count) {
      mean_sharp += a[x], mean_soft += b[x];
      variance_sharp += a[x] * a[x], variance_soft += b[x] * b[x];
      steps += std::abs(a[x] - a[x - 1]), steps_soft += std::abs(b[x] - b[x - 1]);
    }
  }
  mean_sharp /= count, mean_soft /= count;
  const double contrast = std::sqrt((variance_soft / count - mean_soft * mean_soft) /
                                    (variance_sharp / count - mean_sharp * mean_sharp));
  EXPECT_NEAR(mean_soft, mean_sharp, 0.01);
  EXPECT_GT(contrast, 0.5);
  EXPECT_LT(contrast, 0.85);
  EXPECT_LT(steps_soft, 0.7 * steps);
}

}  // namespace
}  // namespace sole::sim
