#include "sim/sensor.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/error.h"
#include "sim/faults.h"

namespace sole::sim {
namespace {

constexpr double kMostBlur_px = 8;
constexpr double kBlurStep_px = 0.02;  // kernels are this fine

/// Gaussian kernels of the blurs that an image needs, and which one each block takes.
struct BlurMap {
  int reach = 0;
  int block = 0;
  std::vector<std::vector<float>> kernels;
  Image<int> kernel_of_block;

  const float* Kernel(int x, int y) const {
    return kernels[static_cast<std::size_t>(kernel_of_block.At(x / block, y / block))].data();
  }
};

std::vector<float> GaussianKernel(double sigma, int reach) {
  std::vector<float> kernel;
  float sum = 0;
  for (int i = -reach; i <= reach; ++i) {
    const double x = sigma > 0 ? i / sigma : (i == 0 ? 0.0 : 1e3);
    kernel.push_back(static_cast<float>(std::exp(-0.5 * x * x)));
    sum += kernel.back();
  }
  for (float& weight : kernel) weight /= sum;
  return kernel;
}

/// Depth of a block, or of its nearest neighbour where it has none: blur reaches across edges.
double DepthNear(const ImageF& depth_m, int x, int y) {
  if (depth_m.At(x, y) > 0) return static_cast<double>(depth_m.At(x, y));
  float nearest = 0;
  for (int j = std::max(y - 1, 0); j <= std::min(y + 1, depth_m.height - 1); ++j) {
    for (int i = std::max(x - 1, 0); i <= std::min(x + 1, depth_m.width - 1); ++i) {
      const float depth = depth_m.At(i, j);
      if (depth > 0 && !(nearest > 0 && nearest < depth)) nearest = depth;
    }
  }
  return static_cast<double>(nearest);
}

BlurMap PlanBlur(const TrueCamera& camera, int width, int height, const ImageF& depth_m,
                 int block) {
  BlurMap map;
  map.block = block;
  map.kernel_of_block = {(width + block - 1) / block, (height + block - 1) / block, 0};
  Require(depth_m.Empty() || (depth_m.width == map.kernel_of_block.width &&
                              depth_m.height == map.kernel_of_block.height),
          "sensor: the depths do not fit the image");
  int last = 0;
  for (int y = 0; y < depth_m.height; ++y) {
    for (int x = 0; x < depth_m.width; ++x) {
      const double depth = DepthNear(depth_m, x, y);
      if (!(depth > 0)) continue;
      const double sigma = std::min(BlurAt(camera, depth), kMostBlur_px);
      int& kernel = map.kernel_of_block.At(x, y);
      kernel = std::max(0, static_cast<int>(std::lround((sigma - camera.blur_px) / kBlurStep_px)));
      last = std::max(last, kernel);
    }
  }
  map.reach = std::max(3, static_cast<int>(std::ceil(3 * (camera.blur_px + last * kBlurStep_px))));
  for (int i = 0; i <= last; ++i)
    map.kernels.push_back(GaussianKernel(camera.blur_px + i * kBlurStep_px, map.reach));
  return map;
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

void BlurRows(const ImageF& in, const BlurMap& blur, ImageF& out) {
  const int reach = blur.reach;
  tbb::parallel_for(tbb::blocked_range<int>(0, in.height, 32), [&](const auto& rows) {
    std::vector<float> padded(static_cast<std::size_t>(in.width + 2 * reach));
    for (int y = rows.begin(); y < rows.end(); ++y) {
      const auto source = in.Row(y);
      std::fill(padded.begin(), padded.begin() + reach, source.front());
      std::copy(source.begin(), source.end(), padded.begin() + reach);
      std::fill(padded.end() - reach, padded.end(), source.back());
      float* const target = out.Row(y).data();
      for (int x0 = 0; x0 < in.width; x0 += blur.block) {
        const int count = std::min(blur.block, in.width - x0);
        const float* const kernel = blur.Kernel(x0, y);
        for (int i = 0; i <= 2 * reach; ++i) {
          const float* const from = padded.data() + x0 + i;
          for (int x = 0; x < count; ++x)
            target[x0 + x] = (i == 0 ? 0 : target[x0 + x]) + kernel[i] * from[x];
        }
      }
    }
  });
}

/// One row of what BlurRows() left, blurred along the columns.
void BlurColumns(const ImageF& rows, const BlurMap& blur, int y, std::vector<float>& line) {
  std::fill(line.begin(), line.end(), 0.0f);
  for (int i = -blur.reach; i <= blur.reach; ++i) {
    const float* const row = rows.Row(std::clamp(y + i, 0, rows.height - 1)).data();
    for (int x0 = 0; x0 < rows.width; x0 += blur.block) {
      const float weight = blur.Kernel(x0, y)[i + blur.reach];
      const int x1 = std::min(x0 + blur.block, rows.width);
      for (int x = x0; x < x1; ++x) line[static_cast<std::size_t>(x)] += weight * row[x];
    }
  }
}

}  // namespace

double NoiseSigma(double level, double analogue_gain) {
  const double electrons_per_level = kElectronsPerLevel / analogue_gain;
  const double electrons = std::max(level - kBlackLevel, 0.0) * electrons_per_level;
  return std::sqrt(electrons + kReadNoiseElectrons * kReadNoiseElectrons) / electrons_per_level;
}

double BlurAt(const TrueCamera& camera, double depth_m) {
  const double circle_px =
      camera.aperture_m * camera.fx * std::abs(1 / camera.focus_m - 1 / depth_m);
  return std::hypot(camera.blur_px, circle_px / 4);  // a disc's coordinates deviate by a quarter
}

ImageU8 Expose(const TrueCamera& camera, const ImageF& arriving, double noise, std::uint64_t seed,
               const ImageF& depth_m, int block) {
  static const NormalTable normal;
  const ImageF fogged = camera.fog > 0 ? Fogged(arriving, camera.fog) : ImageF();
  const ImageF& radiance = camera.fog > 0 ? fogged : arriving;
  const int width = radiance.width, height = radiance.height;
  const BlurMap blur = PlanBlur(camera, width, height, depth_m, block);
  ImageF rows(width, height);
  BlurRows(radiance, blur, rows);
  ImageU8 image(width, height);
  const double corner2 =
      0.25 * (static_cast<double>(width) * width + static_cast<double>(height) * height);
  const auto full = static_cast<float>(255 * camera.gain),
             fall = static_cast<float>(camera.vignetting / corner2),
             black = static_cast<float>(kBlackLevel);
  // Noise variance is linear in the level: electrons of light and of reading.
  const double levels_per_electron = camera.analogue_gain / kElectronsPerLevel;
  const auto photon = static_cast<float>(noise * noise * levels_per_electron),
             read = static_cast<float>(std::pow(noise * NoiseSigma(0, camera.analogue_gain), 2));
  tbb::parallel_for(tbb::blocked_range<int>(0, height, 32), [&](const auto& range) {
    std::vector<float> line(static_cast<std::size_t>(width));
    for (int y = range.begin(); y < range.end(); ++y) {
      BlurColumns(rows, blur, y, line);
      const auto dy = static_cast<float>(y - 0.5 * (height - 1));
      std::uint8_t* const out = image.Row(y).data();
      for (int x = 0; x < width; ++x) {
        const auto dx = static_cast<float>(x - 0.5 * (width - 1));
        const float signal =
            full * (1 - fall * (dx * dx + dy * dy)) * line[static_cast<std::size_t>(x)];
        float level = black + signal;
        if (noise > 0) {
          const auto index = static_cast<std::uint64_t>(y) * static_cast<std::uint64_t>(width) +
                             static_cast<std::uint64_t>(x);
          level += std::sqrt(photon * std::max(signal, 0.0f) + read) *
                   normal.At(Mix(seed + Mix(index)));
        }
        out[x] = static_cast<std::uint8_t>(std::clamp(level + 0.5f, 0.0f, 255.0f));
      }
    }
  });
  if (camera.hot_pixels > 0) AddHotPixels(camera.serial, camera.hot_pixels, image);
  return image;
}

}  // namespace sole::sim
