#include "recon/prepared_image.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <limits>
#include <utility>
#include <vector>

#include "core/error.h"
#include "recon/subset_kernel_internal.h"

namespace sole::recon {
namespace {

constexpr float kPole = -0.26794919F;  // sqrt(3) - 2
constexpr int kHorizon = 14;           // kPole^14 < 1e-8
constexpr int kTile = 32;

/// Pixels [begin, end) of a row or column.
struct Span {
  int begin, end;
};

/// Which tiles of an image are filtered: those with masked pixels and their neighbours.
class Tiles {
 public:
  Tiles(int width, int height, const ImageU8* mask)
      : width_(width),
        height_(height),
        cols_((width + kTile - 1) / kTile),
        rows_((height + kTile - 1) / kTile),
        on_(static_cast<std::size_t>(cols_) * static_cast<std::size_t>(rows_), mask ? 0 : 1) {
    if (!mask) return;
    for (int y = 0; y < height; ++y) {
      const std::uint8_t* row = mask->Row(y).data();
      for (int tile = 0; tile < cols_; ++tile) {
        const int begin = tile * kTile, end = std::min(begin + kTile, width);
        if (std::any_of(row + begin, row + end, [](std::uint8_t m) { return m != 0; }))
          SwitchOnAround(tile, y / kTile);
      }
    }
  }

  int Cols() const { return cols_; }
  int Rows() const { return rows_; }

  /// Runs of tiles along a row of tiles.
  std::vector<Span> Across(int row) const {
    return Runs(cols_, width_, [&](int tile) { return On(tile, row); });
  }
  /// Runs of tiles down a column of tiles.
  std::vector<Span> Down(int col) const {
    return Runs(rows_, height_, [&](int tile) { return On(col, tile); });
  }

 private:
  std::size_t Index(int col, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(cols_) +
           static_cast<std::size_t>(col);
  }
  bool On(int col, int row) const { return on_[Index(col, row)] != 0; }

  void SwitchOnAround(int col, int row) {
    for (int y = std::max(0, row - 1); y <= std::min(rows_ - 1, row + 1); ++y) {
      for (int x = std::max(0, col - 1); x <= std::min(cols_ - 1, col + 1); ++x)
        on_[Index(x, y)] = 1;
    }
  }

  template <typename F>
  static std::vector<Span> Runs(int tiles, int pixels, const F& on) {
    std::vector<Span> runs;
    for (int tile = 0; tile < tiles; ++tile) {
      if (!on(tile)) continue;
      const int begin = tile * kTile, end = std::min(begin + kTile, pixels);
      if (!runs.empty() && runs.back().end == begin) runs.back().end = end;
      else runs.push_back({begin, end});
    }
    return runs;
  }

  int width_, height_, cols_, rows_;
  std::vector<char> on_;
};

/// Cubic B-spline prefilter of N lines of `n` values, `stride` apart, in place (mirrored ends; Unser
/// 1993). Each line depends on itself alone, so that several keep the processor busy.
template <int N>
void PrefilterRows(float* first, std::ptrdiff_t stride, int n) {
  std::array<float*, N> line;
  for (std::size_t k = 0; k < N; ++k) line[k] = first + static_cast<std::ptrdiff_t>(k) * stride;
  for (float* at : line) {
    float sum = 0, power = 1;
    for (int i = 0; i < std::min(kHorizon, n); ++i, power *= kPole) sum += power * at[i];
    at[0] = 6 * sum;
  }
  std::array<float, N> last;
  for (std::size_t k = 0; k < N; ++k) last[k] = line[k][0];
  for (int i = 1; i < n; ++i) {
    for (std::size_t k = 0; k < N; ++k) line[k][i] = last[k] = 6 * line[k][i] + kPole * last[k];
  }
  for (std::size_t k = 0; k < N; ++k) {
    float& end = line[k][n - 1];
    end = last[k] = kPole / (kPole * kPole - 1) * (end + kPole * line[k][n - 2]);
  }
  for (int i = n - 2; i >= 0; --i) {
    for (std::size_t k = 0; k < N; ++k) line[k][i] = last[k] = kPole * (last[k] - line[k][i]);
  }
}

/// The same down the columns [x.begin, x.end) between two rows, row by row so that neighbours are
/// handled together.
void PrefilterColumns(ImageF& image, Span x, Span y) {
  std::array<float, kTile> sum{};
  float power = 1;
  for (int j = y.begin; j < std::min(y.begin + kHorizon, y.end); ++j, power *= kPole) {
    const float* row = image.Row(j).data() + x.begin;
    for (int i = 0; i < x.end - x.begin; ++i) sum[static_cast<std::size_t>(i)] += power * row[i];
  }
  float* first = image.Row(y.begin).data() + x.begin;
  for (int i = 0; i < x.end - x.begin; ++i) first[i] = 6 * sum[static_cast<std::size_t>(i)];
  for (int j = y.begin + 1; j < y.end; ++j) {
    const float* above = image.Row(j - 1).data();
    float* row = image.Row(j).data();
    for (int i = x.begin; i < x.end; ++i) row[i] = 6 * row[i] + kPole * above[i];
  }
  const float* before = image.Row(y.end - 2).data();
  float* last = image.Row(y.end - 1).data();
  for (int i = x.begin; i < x.end; ++i)
    last[i] = kPole / (kPole * kPole - 1) * (last[i] + kPole * before[i]);
  for (int j = y.end - 2; j >= y.begin; --j) {
    const float* below = image.Row(j + 1).data();
    float* row = image.Row(j).data();
    for (int i = x.begin; i < x.end; ++i) row[i] = kPole * (below[i] - row[i]);
  }
}

void PrefilterRow(ImageF& image, int y, Span x, int rows) {
  float* first = image.Row(y).data() + x.begin;
  const int n = x.end - x.begin;
  if (rows == 4) PrefilterRows<4>(first, image.width, n);
  else for (int j = 0; j < rows; ++j) PrefilterRows<1>(first + j * image.width, image.width, n);
}

/// `fill` puts the grey levels of a row between two columns into the coefficients.
template <typename Fill>
void Prefilter(ImageF& coefficients, const ImageU8* mask, const Fill& fill) {
  const Tiles tiles(coefficients.width, coefficients.height, mask);
  tbb::parallel_for(0, tiles.Rows(), [&](int tile) {
    const std::vector<Span> runs = tiles.Across(tile);
    const int end = std::min((tile + 1) * kTile, coefficients.height);
    for (int y = tile * kTile; y < end; y += 4) {
      const int rows = std::min(4, end - y);
      for (const Span& run : runs) {
        for (int j = y; j < y + rows; ++j) fill(j, run);
        PrefilterRow(coefficients, y, run, rows);
      }
    }
  });
  tbb::parallel_for(0, tiles.Cols(), [&](int tile) {
    const Span across{tile * kTile, std::min((tile + 1) * kTile, coefficients.width)};
    for (const Span& run : tiles.Down(tile)) PrefilterColumns(coefficients, across, run);
  });
}

void CheckSize(int width, int height) {
  Require(width >= 16 && height >= 16, "image too small to match: at least 16 x 16 pixels");
}

}  // namespace

PreparedImage Prepare(const ImageU8& image, const ImageU8* mask) {
  CheckSize(image.width, image.height);
  Require(!mask || (mask->width == image.width && mask->height == image.height),
          "the mask must have the size of its image");
  PreparedImage result{ImageF(image.width, image.height)};
  Prefilter(result.coefficients, mask, [&](int y, Span x) {
    std::copy(image.Row(y).begin() + x.begin, image.Row(y).begin() + x.end,
              result.coefficients.Row(y).begin() + x.begin);
  });
  return result;
}

PreparedImage Prepare(ImageF grey) {
  CheckSize(grey.width, grey.height);
  PreparedImage result{std::move(grey)};
  Prefilter(result.coefficients, nullptr, [](int, Span) {});
  return result;
}

double GreyAt(const PreparedImage& image, const Eigen::Vector2d& position_px) {
  const ImageF& c = image.coefficients;
  if (!(position_px.x() >= 2 && position_px.y() >= 2 && position_px.x() <= c.width - 4 &&
        position_px.y() <= c.height - 4)) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  return static_cast<double>(SplineAt(c.pixels.data(), c.width, 0, 0,
                                      static_cast<float>(position_px.x()),
                                      static_cast<float>(position_px.y())));
}

}  // namespace sole::recon
