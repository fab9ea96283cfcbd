#include "capture/image_sample.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

namespace sole::capture {
namespace {

constexpr int kBlocks = 40;         // along the longer side
constexpr int kPoints = 8;          // each way in a block
constexpr double kLitDeviation = 12;  // grey levels; sensor noise stays far below
constexpr int kSaturated = 250;
constexpr double kFootShare = 0.04;

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Size of the largest 4-connected region of `lit`, which is used up.
int LargestRegion(std::vector<char> lit, int columns, int rows) {
  int largest = 0;
  std::vector<int> open;
  for (int start = 0; start < columns * rows; ++start) {
    if (!lit[static_cast<std::size_t>(start)]) continue;
    int size = 0;
    open.assign(1, start);
    lit[static_cast<std::size_t>(start)] = 0;
    while (!open.empty()) {
      const int at = open.back(), x = at % columns, y = at / columns;
      open.pop_back();
      ++size;
      const std::array<std::array<int, 2>, 4> next{{{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}}};
      for (const auto& [nx, ny] : next) {
        if (nx < 0 || ny < 0 || nx >= columns || ny >= rows) continue;
        const auto index = static_cast<std::size_t>(ny * columns + nx);
        if (!lit[index]) continue;
        lit[index] = 0;
        open.push_back(ny * columns + nx);
      }
    }
    largest = std::max(largest, size);
  }
  return largest;
}

}  // namespace

ImageSample SampleImage(int width, int height, std::span<const std::uint8_t> pixels) {
  ImageSample sample;
  const auto stride = static_cast<std::size_t>(width);
  if (width < 64 || height < 64 || pixels.size() < stride * static_cast<std::size_t>(height))
    return sample;
  const int side = std::max(kPoints, (std::max(width, height) + kBlocks - 1) / kBlocks);
  const int columns = width / side, rows = height / side;
  const auto blocks = static_cast<std::size_t>(columns * rows);
  std::array<int, 256> histogram{};
  std::vector<char> lit(blocks, 0);
  std::vector<double> contrasts, differences;
  sample.levels.reserve(blocks * kPoints * kPoints);
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      int sum = 0, squares = 0, difference = 0;
      for (int j = 0; j < kPoints; ++j) {
        const int y = row * side + (2 * j + 1) * side / (2 * kPoints);
        const std::uint8_t* line = pixels.data() + static_cast<std::size_t>(y) * stride;
        for (int i = 0; i < kPoints; ++i) {
          const int x =
              std::clamp(column * side + (2 * i + 1) * side / (2 * kPoints), 1, width - 2);
          const int level = line[x];
          sample.levels.push_back(line[x]);
          ++histogram[static_cast<std::size_t>(level)];
          sum += level;
          squares += level * level;
          difference += std::abs(line[x + 1] - line[x - 1]);
        }
      }
      constexpr double kCount = kPoints * kPoints;
      const double mean = sum / kCount;
      const double deviation = std::sqrt(std::max(0.0, squares / kCount - mean * mean));
      if (deviation <= kLitDeviation) continue;
      lit[static_cast<std::size_t>(row * columns + column)] = 1;
      contrasts.push_back(deviation / mean);
      differences.push_back(difference / kCount / mean);
    }
  }
  const auto points = static_cast<double>(sample.levels.size());
  double below = 0, total = 0;
  for (std::size_t level = 0; level < histogram.size(); ++level) {
    const double count = histogram[level];
    if (below < 0.1 * points) sample.dark_level = static_cast<double>(level);
    below += count;
    total += count * static_cast<double>(level);
    if (level >= kSaturated) sample.saturated += count / points;
  }
  sample.mean = total / points;
  sample.lit = static_cast<double>(contrasts.size()) / static_cast<double>(blocks);
  sample.largest_lit = LargestRegion(lit, columns, rows) / static_cast<double>(blocks);
  sample.contrast = Median(std::move(contrasts));
  sample.focus = Median(std::move(differences));
  return sample;
}

double MotionBetween(const ImageSample& a, const ImageSample& b) {
  if (a.levels.size() != b.levels.size() || a.levels.empty()) return 0;
  std::int64_t sum = 0;
  for (std::size_t i = 0; i < a.levels.size(); ++i) sum += std::abs(a.levels[i] - b.levels[i]);
  return static_cast<double>(sum) / static_cast<double>(a.levels.size());
}

bool FootInView(const ImageSample& sample) { return sample.largest_lit > kFootShare; }

}  // namespace sole::capture
