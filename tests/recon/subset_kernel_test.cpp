// The comparison for wide vectors against the one for the processor's baseline.
#include <gtest/gtest.h>

#include <memory>
#include <random>

#include "recon/subset.h"
#include "recon/subset_kernel_internal.h"

namespace sole::recon {
namespace {

ImageF Noise(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> grey(0, 255);
  ImageF image(width, height);
  for (float& level : image.pixels) level = grey(random);
  return image;
}

TEST(Compare, WideVectorsGiveWhatTheBaselineGives) {
  if (!HasAvx2()) GTEST_SKIP() << "this processor has no AVX2";
  const PreparedImage left = Prepare(Noise(120, 100, 1)), right = Prepare(Noise(140, 90, 2));
  ImageU8 mask(120, 100, 255);
  for (int y = 0; y < 100; ++y)
    for (int x = 0; x < 50; ++x) mask.At(x, y) = (x + y) % 7 == 0 ? 0 : 255;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto window = std::make_unique<SubsetWindow>();
  for (int trial = 0; trial < 200; ++trial) {
    const int radius = 2 + trial % 14;
    FillWindow(left.coefficients, trial % 2 ? &mask : nullptr,
               50 + trial % 9, 40 + trial % 5, radius, *window);
    WarpPolynomial warp{};
    warp[0] = {70 + 20 * unit(random), 1 + 0.2 * unit(random), 0.2 * unit(random),
               0.01 * unit(random), 0.01 * unit(random), 0.01 * unit(random)};
    warp[1] = {45 + 10 * unit(random), 0.2 * unit(random), 1 + 0.2 * unit(random),
               0.01 * unit(random), 0.01 * unit(random), 0.01 * unit(random)};
    const SubsetComparison a = CompareBaseline(*window, right.coefficients, warp),
                           b = CompareAvx2(*window, right.coefficients, warp);
    ASSERT_EQ(a.inside, b.inside);
    if (!a.inside) continue;
    EXPECT_NEAR(a.zncc, b.zncc, 1e-4);
    EXPECT_NEAR(a.squared_residual, b.squared_residual, 1e-4 * a.squared_residual);
    double scale = 0;
    for (const double g : a.gradient) scale = std::max(scale, std::abs(g));
    for (std::size_t k = 0; k < 6; ++k) EXPECT_NEAR(a.gradient[k], b.gradient[k], 1e-3 * scale);
  }
}

TEST(Compare, ReadsTheSplineBetweenPixels) {
  // A window of ones at zero mean is no use, but its neighbour's grey levels can be told apart.
  const ImageF noise = Noise(60, 60, 5);
  const PreparedImage left = Prepare(noise), right = Prepare(noise);
  const auto window = std::make_unique<SubsetWindow>();
  FillWindow(left.coefficients, nullptr, 30, 30, 6, *window);
  WarpPolynomial warp{};
  warp[0] = {30, 1, 0, 0, 0, 0};
  warp[1] = {30, 0, 1, 0, 0, 0};
  for (const auto& compare : {CompareBaseline, CompareAvx2}) {
    if (compare == &CompareAvx2 && !HasAvx2()) continue;
    const SubsetComparison same = compare(*window, right.coefficients, warp);
    EXPECT_NEAR(same.zncc, 1, 1e-5);  // the spline runs through the pixels
    EXPECT_LT(same.squared_residual, 1e-2);
    warp[0][0] = 1;
    EXPECT_FALSE(compare(*window, right.coefficients, warp).inside);
    warp[0][0] = 30;
  }
}

}  // namespace
}  // namespace sole::recon
