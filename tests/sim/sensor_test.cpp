#include "sim/sensor.h"

#include <cmath>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

namespace sole::sim {
namespace {

TrueCamera FlatCamera() {
  TrueCamera camera;
  camera.width = 400;
  camera.height = 300;
  camera.vignetting = 0;
  return camera;
}

struct Moments {
  double mean = 0, sd = 0;
};

Moments Measure(const ImageU8& image) {
  double sum = 0, square = 0;
  for (const std::uint8_t value : image.pixels) {
    sum += value;
    square += static_cast<double>(value) * value;
  }
  const auto count = static_cast<double>(image.pixels.size());
  const double mean = sum / count;
  return {mean, std::sqrt(square / count - mean * mean)};
}

TEST(Expose, NoiseHasTheRequestedLevel) {
  const TrueCamera camera = FlatCamera();
  for (const double grey : {20.0, 100.0, 200.0}) {
    const ImageF flat(camera.width, camera.height, static_cast<float>(grey / 255));
    for (const double scale : {0.5, 1.0, 2.0}) {
      const Moments found = Measure(Expose(camera, flat, scale, 11));
      // Photon noise of 39.2 electrons per level and 8 electrons of read noise, and rounding to
      // whole levels.
      const double electrons = grey * 10000 / 255;
      const double sigma = scale * std::sqrt(electrons + 64) / (10000.0 / 255);
      EXPECT_NEAR(found.mean, grey + kBlackLevel, 0.05);
      if (sigma < 0.5) continue;  // rounding to whole levels is no longer like noise
      EXPECT_NEAR(found.sd, std::sqrt(sigma * sigma + 1.0 / 12), 0.03 * sigma);
    }
  }
}

TEST(Expose, AnalogueGainAmplifiesNoise) {
  // Grey 100 at a gain of 4 is a quarter of the electrons.
  TrueCamera camera = FlatCamera();
  camera.gain = camera.analogue_gain = 4;
  const ImageF flat(camera.width, camera.height, static_cast<float>(25.0 / 255));
  const Moments found = Measure(Expose(camera, flat, 1, 3));
  const double sigma = 4 * std::sqrt(25 * 10000.0 / 255 + 64) / (10000.0 / 255);
  EXPECT_NEAR(found.mean, 100 + kBlackLevel, 0.1);
  EXPECT_NEAR(found.sd, std::sqrt(sigma * sigma + 1.0 / 12), 0.03 * sigma);
  EXPECT_NEAR(NoiseSigma(100 + kBlackLevel, 4), sigma, 1e-9);
}

TEST(Expose, BlursWhatIsOutOfFocusByItsCircleOfConfusion) {
  TrueCamera camera = FlatCamera();
  camera.fx = 3250;
  camera.aperture_m = 0.004;
  camera.focus_m = 0.6;
  ImageF dots(camera.width, camera.height);
  dots.At(100, 100) = dots.At(300, 100) = 2.2f;  // just below saturation in focus
  ImageF depth(50, 38);
  for (int y = 0; y < 38; ++y) {
    for (int x = 0; x < 50; ++x) depth.At(x, y) = x < 25 ? 0.6f : 0.5f;
  }
  const ImageU8 image = Expose(camera, dots, 0, 1, depth, 8);
  const auto spread = [&](int x0) {
    double sum = 0, square = 0;
    for (int y = 85; y < 116; ++y) {
      for (int x = x0 - 15; x <= x0 + 15; ++x) {
        sum += image.At(x, y) - kBlackLevel;
        square += (image.At(x, y) - kBlackLevel) * (x - x0) * (x - x0);
      }
    }
    return std::sqrt(square / sum);
  };
  // A disc of diameter aperture * f * |1/focus - 1/depth| deviates by a quarter of it.
  const double circle_px = 0.004 * 3250 * (1 / 0.5 - 1 / 0.6);
  EXPECT_NEAR(spread(100), camera.blur_px, 0.05);
  EXPECT_NEAR(spread(300), std::hypot(camera.blur_px, circle_px / 4), 0.09);  // tails round to 0
  EXPECT_NEAR(BlurAt(camera, 0.5), std::hypot(camera.blur_px, circle_px / 4), 1e-12);
}

TEST(Expose, WithoutNoiseRoundsAndVignettes) {
  TrueCamera camera = FlatCamera();
  camera.vignetting = 0.2;
  const ImageU8 image = Expose(camera, ImageF(camera.width, camera.height, 0.5f), 0, 1);
  EXPECT_NEAR(image.At(200, 150), kBlackLevel + 127.5, 0.6);
  EXPECT_NEAR(image.At(0, 0), kBlackLevel + 0.8 * 127.5, 1.5);
  EXPECT_EQ(Expose(FlatCamera(), ImageF(400, 300, 3.0f), 1, 1).At(5, 5), 255);
}

TEST(Expose, BlurKeepsPlaceAndSum) {
  TrueCamera camera = FlatCamera();
  camera.blur_px = 0.7;
  ImageF dot(camera.width, camera.height);
  dot.At(50, 60) = 2.5f;
  const ImageU8 image = Expose(camera, dot, 0, 1);
  double sum = 0, x_sum = 0;
  for (int y = 50; y < 71; ++y) {
    for (int x = 40; x < 61; ++x) {
      sum += image.At(x, y) - kBlackLevel;
      x_sum += (image.At(x, y) - kBlackLevel) * x;
    }
  }
  EXPECT_NEAR(sum, 2.5 * 255, 6);
  EXPECT_NEAR(x_sum / sum, 50, 1e-6);
}

TEST(Expose, DependsOnSeedAndNotOnThreads) {
  const TrueCamera camera = FlatCamera();
  const ImageF flat(camera.width, camera.height, 0.4f);
  const ImageU8 image = Expose(camera, flat, 1, 5);
  EXPECT_NE(Expose(camera, flat, 1, 6).pixels, image.pixels);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(Expose(camera, flat, 1, 5).pixels, image.pixels);
}

}  // namespace
}  // namespace sole::sim
