#include "sim/speckle.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <random>

namespace sole::sim {
namespace {

constexpr int kSize = 2048;          // texels; a power of two
constexpr double kDotTexels = 6.25;  // mean diameter
constexpr double kPitchTexels = 8.0;
constexpr double kSoftTexels = 2.5;  // width of a dot's edge
constexpr double kFloor = 0.06;      // light between the dots

std::size_t Texel(int x, int y) {
  return static_cast<std::size_t>(y & (kSize - 1)) * kSize +
         static_cast<std::size_t>(x & (kSize - 1));
}

/// Blurs the tile, which repeats, by a Gaussian, first along rows, then along columns.
void BlurTile(double sigma_texels, std::vector<float>& tile) {
  const int reach = std::max(1, static_cast<int>(std::ceil(3 * sigma_texels)));
  std::vector<float> kernel;
  for (int i = -reach; i <= reach; ++i) {
    kernel.push_back(static_cast<float>(std::exp(-0.5 * i * i / (sigma_texels * sigma_texels))));
  }
  const float sum = std::accumulate(kernel.begin(), kernel.end(), 0.0f);
  std::vector<float> rows(tile.size(), 0.0f), wrapped(kSize + 2 * static_cast<std::size_t>(reach));
  for (int y = 0; y < kSize; ++y) {
    for (std::size_t i = 0; i < wrapped.size(); ++i) {
      wrapped[i] = tile[Texel(static_cast<int>(i) - reach, y)];
    }
    float* const out = rows.data() + Texel(0, y);
    for (std::size_t k = 0; k < kernel.size(); ++k) {
      for (std::size_t x = 0; x < kSize; ++x) out[x] += kernel[k] / sum * wrapped[x + k];
    }
  }
  std::fill(tile.begin(), tile.end(), 0.0f);
  for (int y = 0; y < kSize; ++y) {
    float* const out = tile.data() + Texel(0, y);
    for (int i = -reach; i <= reach; ++i) {
      const float weight = kernel[static_cast<std::size_t>(i + reach)] / sum;
      const float* const in = rows.data() + Texel(0, y + i);
      for (std::size_t x = 0; x < kSize; ++x) out[x] += weight * in[x];
    }
  }
}

}  // namespace

SpecklePattern::SpecklePattern(std::uint64_t seed, double dot_rad)
    : texels_per_unit_(kDotTexels / dot_rad),
      texels_(static_cast<std::size_t>(kSize) * kSize, static_cast<std::uint8_t>(255 * kFloor)) {
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  constexpr int kCells = static_cast<int>(kSize / kPitchTexels);
  for (int cell = 0; cell < kCells * kCells; ++cell) {
    if (unit(engine) < 0.15) continue;  // gaps make the pattern less regular
    const double cx = (cell % kCells + 0.5 + 0.9 * (unit(engine) - 0.5)) * kPitchTexels;
    const double cy = (cell / kCells + 0.5 + 0.9 * (unit(engine) - 0.5)) * kPitchTexels;
    const double radius = 0.5 * kDotTexels * (0.75 + 0.5 * unit(engine));
    const double level = 0.65 + 0.35 * unit(engine);
    const int reach = static_cast<int>(radius) + 3;
    const int x0 = static_cast<int>(cx), y0 = static_cast<int>(cy);
    for (int y = y0 - reach; y <= y0 + reach; ++y) {
      for (int x = x0 - reach; x <= x0 + reach; ++x) {
        const double distance2 = (x - cx) * (x - cx) + (y - cy) * (y - cy);
        if (distance2 > (radius + 0.5 * kSoftTexels) * (radius + 0.5 * kSoftTexels)) continue;
        const double edge =
            std::clamp(0.5 + (radius - std::sqrt(distance2)) / kSoftTexels, 0.0, 1.0);
        const double light = kFloor + (level - kFloor) * edge * edge * (3 - 2 * edge);
        std::uint8_t& texel = texels_[Texel(x, y)];
        texel = std::max(texel, static_cast<std::uint8_t>(std::lround(255 * light)));
      }
    }
  }
}

float SpecklePattern::At(double x, double y) const {
  const double u = x * texels_per_unit_, v = y * texels_per_unit_;
  int iu = static_cast<int>(u), iv = static_cast<int>(v);
  iu -= u < iu;  // rounds down below zero, too
  iv -= v < iv;
  const auto a = static_cast<float>(u - iu), b = static_cast<float>(v - iv);
  const float top = (1 - a) * texels_[Texel(iu, iv)] + a * texels_[Texel(iu + 1, iv)];
  const float bottom = (1 - a) * texels_[Texel(iu, iv + 1)] + a * texels_[Texel(iu + 1, iv + 1)];
  return ((1 - b) * top + b * bottom) * (1.0f / 255);
}

SpecklePattern SpecklePattern::Scattered(double near_rad, double far_share) const {
  std::vector<float> near(texels_.begin(), texels_.end());
  BlurTile(near_rad * texels_per_unit_, near);
  double mean = 0;
  for (const std::uint8_t texel : texels_) mean += texel;
  mean /= static_cast<double>(texels_.size());
  const auto kept = static_cast<float>(1 - far_share), veil = static_cast<float>(far_share * mean);
  SpecklePattern scattered = *this;
  for (std::size_t i = 0; i < near.size(); ++i) {
    scattered.texels_[i] = static_cast<std::uint8_t>(kept * near[i] + veil + 0.5f);
  }
  return scattered;
}

}  // namespace sole::sim
