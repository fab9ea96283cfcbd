#include "sim/sensor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "sim/faults.h"

namespace sole::sim {
namespace {

constexpr int kReach = 3;
using Kernel = std::array<float, 2 * kReach + 1>;

Kernel GaussianKernel(double sigma) {
  Kernel kernel{};
  float sum = 0;
  for (int i = -kReach; i <= kReach; ++i) {
    const double x = sigma > 0 ? i / sigma : (i == 0 ? 0.0 : 1e3);
    sum += kernel[static_cast<std::size_t>(i + kReach)] =
        static_cast<float>(std::exp(-0.5 * x * x));
  }
  for (float& weight : kernel) weight /= sum;
  return kernel;
}

std::uint64_t Mix(std::uint64_t x) {  // splitmix64
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}

/// Standard normal deviates addressed by a counter: table lookup of the inverse distribution, so
/// that a pixel's noise depends on nothing but the seed and its index.
class NormalTable {
 public:
  NormalTable() {
    // Midpoints of 65,536 equal shares of probability, by bisection on erfc, one half mirrored.
    for (int i = 0; i < kHalf; ++i) {
      const double p = (i + 0.5) / (2.0 * kHalf);
      double low = -6, high = 0;
      for (int step = 0; step < 40; ++step) {
        const double mid = 0.5 * (low + high);
        (0.5 * std::erfc(-mid / std::numbers::sqrt2) < p ? low : high) = mid;
      }
      values_[static_cast<std::size_t>(i)] = static_cast<float>(low);
      values_[static_cast<std::size_t>(2 * kHalf - 1 - i)] = static_cast<float>(-low);
    }
  }
  float At(std::uint64_t random) const { return values_[random & (2 * kHalf - 1)]; }

 private:
  static constexpr int kHalf = 32768;
  std::vector<float> values_ = std::vector<float>(2 * kHalf);
};

void BlurRows(const ImageF& in, const Kernel& kernel, ImageF& out) {
  tbb::parallel_for(tbb::blocked_range<int>(0, in.height, 32), [&](const auto& rows) {
    for (int y = rows.begin(); y < rows.end(); ++y) {
      const auto source = in.Row(y);
      const auto target = out.Row(y);
      for (int x = 0; x < in.width; ++x) {
        float sum = 0;
        for (int i = -kReach; i <= kReach; ++i) {
          sum += kernel[static_cast<std::size_t>(i + kReach)] *
                 source[static_cast<std::size_t>(std::clamp(x + i, 0, in.width - 1))];
        }
        target[static_cast<std::size_t>(x)] = sum;
      }
    }
  });
}

}  // namespace

double NoiseSigma(double level) {
  const double electrons = std::max(level - kBlackLevel, 0.0) * kElectronsPerLevel;
  return std::sqrt(electrons + kReadNoiseElectrons * kReadNoiseElectrons) / kElectronsPerLevel;
}

ImageU8 Expose(const TrueCamera& camera, const ImageF& arriving, double noise, std::uint64_t seed) {
  static const NormalTable normal;
  const Kernel kernel = GaussianKernel(camera.blur_px);
  const ImageF fogged = camera.fog > 0 ? Fogged(arriving, camera.fog) : ImageF();
  const ImageF& radiance = camera.fog > 0 ? fogged : arriving;
  const int width = radiance.width, height = radiance.height;
  ImageF rows(width, height);
  BlurRows(radiance, kernel, rows);
  ImageU8 image(width, height);
  const double corner2 =
      0.25 * (static_cast<double>(width) * width + static_cast<double>(height) * height);
  tbb::parallel_for(tbb::blocked_range<int>(0, height, 32), [&](const auto& range) {
    std::vector<float> line(static_cast<std::size_t>(width));
    for (int y = range.begin(); y < range.end(); ++y) {
      std::fill(line.begin(), line.end(), 0.0f);
      for (int i = -kReach; i <= kReach; ++i) {
        const auto row = rows.Row(std::clamp(y + i, 0, height - 1));
        const float weight = kernel[static_cast<std::size_t>(i + kReach)];
        for (std::size_t x = 0; x < line.size(); ++x) line[x] += weight * row[x];
      }
      const double dy = y - 0.5 * (height - 1);
      for (int x = 0; x < width; ++x) {
        const double dx = x - 0.5 * (width - 1);
        const double shade = 1 - camera.vignetting * (dx * dx + dy * dy) / corner2;
        const double signal =
            255 * camera.gain * shade * static_cast<double>(line[static_cast<std::size_t>(x)]);
        double level = kBlackLevel + signal;
        if (noise > 0) {
          const auto index = static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(width) +
                             static_cast<std::uint64_t>(x);
          level +=
              noise * NoiseSigma(level) * static_cast<double>(normal.At(Mix(seed + Mix(index))));
        }
        image.At(x, y) = static_cast<std::uint8_t>(std::clamp(std::lround(level), 0L, 255L));
      }
    }
  });
  if (camera.hot_pixels > 0) AddHotPixels(camera.serial, camera.hot_pixels, image);
  return image;
}

}  // namespace sole::sim
