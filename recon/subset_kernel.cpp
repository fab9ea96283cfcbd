#include <algorithm>
#include <cmath>

#include "recon/subset_kernel_internal.h"

namespace sole::recon {

namespace {

/// 1 where four mask values are not 0.
Float4 MaskWeights(const std::uint8_t* mask) {
  using Bytes4 = std::uint8_t __attribute__((vector_size(4)));
  using Int4 = std::int32_t __attribute__((vector_size(16)));
  Bytes4 bytes;
  std::memcpy(&bytes, mask, sizeof bytes);
  const Int4 in = __builtin_convertvector(bytes, Int4) != 0;
  return __builtin_convertvector(-in, Float4);
}

}  // namespace

void FillWindow(const ImageF& coefficients, const ImageU8* mask, int x, int y, int radius,
                SubsetWindow& window) {
  window.radius = radius;
  window.stride = (2 * radius + 1 + 7) / 8 * 8;
  const int size = window.Rows();
  alignas(16) std::array<float, kMaxStride> column{};  // 1 in the window, 0 in the padding
  for (int i = 0; i < window.stride; ++i) {
    const auto k = static_cast<std::size_t>(i);
    window.offset[k] = i < size ? static_cast<float>(i - radius) : 0.0F;
    column[k] = i < size ? 1.0F : 0.0F;
  }
  // The padding is read too. That passes the end of an image's row, not of the image: another row
  // follows the window's.
  const auto width = static_cast<std::size_t>(coefficients.width);
  const std::size_t corner =
      static_cast<std::size_t>(y - radius) * width + static_cast<std::size_t>(x - radius);
  constexpr float kGrey = 1.0F / 36, kSlope = 1.0F / 12;
  Float4 sum{}, count{};
  for (int j = 0; j < size; ++j) {
    const std::size_t row = corner + static_cast<std::size_t>(j) * width;
    for (int i = 0; i < window.stride; i += 4) {
      const auto to = static_cast<std::size_t>(j * window.stride + i);
      const std::size_t from = row + static_cast<std::size_t>(i);
      Float4 weight = Load4(&column[static_cast<std::size_t>(i)]);
      if (mask) weight *= MaskWeights(&mask->pixels[from]);
      // Of the columns left, here and right: the spline's value and slope down them.
      std::array<Float4, 3> value, slope;
      for (std::size_t k = 0; k < 3; ++k) {
        const float* at = &coefficients.pixels[from + k - 1];
        const Float4 above = Load4(at - width), below = Load4(at + width);
        value[k] = above + 4 * Load4(at) + below;
        slope[k] = below - above;
      }
      const Float4 grey = (kGrey * weight) * (value[0] + 4 * value[1] + value[2]);
      Store4(&window.weight[to], weight);
      Store4(&window.grey[to], grey);
      Store4(&window.gradient_x[to], (kSlope * weight) * (value[2] - value[0]));
      Store4(&window.gradient_y[to], (kSlope * weight) * (slope[0] + 4 * slope[1] + slope[2]));
      sum += grey;
      count += weight;
    }
  }
  window.count = Sum4(count);
  const float mean = Sum4(sum) / std::max(window.count, 1.0F);
  Float4 squares{};
  for (int k = 0; k < size * window.stride; k += 4) {
    const auto i = static_cast<std::size_t>(k);
    const Float4 value = Load4(&window.grey[i]) - mean * Load4(&window.weight[i]);
    Store4(&window.grey[i], value);
    squares += value * value;
  }
  window.norm = std::sqrt(Sum4(squares));
}

std::array<double, 36> NormalMatrix(const SubsetWindow& window) {
  // Sums of {gx gx, gx gy, gy gy} times {1, x, y, x x, x y, y y}.
  std::array<std::array<Float4, 6>, 3> sums{};
  for (int j = 0; j < window.Rows(); ++j) {
    std::array<std::array<Float4, 3>, 3> row{};
    for (int i = 0; i < window.stride; i += 4) {
      const auto k = static_cast<std::size_t>(j * window.stride + i);
      const Float4 gx = Load4(&window.gradient_x[k]), gy = Load4(&window.gradient_y[k]);
      const Float4 x = Load4(&window.offset[static_cast<std::size_t>(i)]);
      const std::array<Float4, 3> product{gx * gx, gx * gy, gy * gy};
      for (std::size_t p = 0; p < 3; ++p) {
        row[p][0] += product[p];
        row[p][1] += product[p] * x;
        row[p][2] += product[p] * x * x;
      }
    }
    const auto y = static_cast<float>(j - window.radius);
    for (std::size_t p = 0; p < 3; ++p) {
      sums[p][0] += row[p][0];
      sums[p][1] += row[p][1];
      sums[p][2] += row[p][0] * y;
      sums[p][3] += row[p][2];
      sums[p][4] += row[p][1] * y;
      sums[p][5] += row[p][0] * (y * y);
    }
  }
  constexpr std::array<std::array<std::size_t, 3>, 3> kMoment{{{0, 1, 2}, {1, 3, 4}, {2, 4, 5}}};
  std::array<std::array<double, 6>, 3> total{};
  for (std::size_t p = 0; p < 3; ++p) {
    for (std::size_t m = 0; m < 6; ++m) total[p][m] = static_cast<double>(Sum4(sums[p][m]));
  }
  std::array<double, 36> matrix{};
  for (std::size_t a = 0; a < 6; ++a) {
    for (std::size_t b = 0; b < 6; ++b)
      matrix[a * 6 + b] = total[a / 3 + b / 3][kMoment[a % 3][b % 3]];
  }
  return matrix;
}

namespace {

/// Largest distance of a warped window pixel from the warped centre along one axis.
double Reach(const std::array<double, 6>& c, double r) {
  return r * (std::abs(c[1]) + std::abs(c[2])) +
         r * r * (std::abs(c[3]) + std::abs(c[4]) + std::abs(c[5]));
}

/// Reads the right image's grey levels under the warp into `values`.
void Sample(const SubsetWindow& window, const ImageF& coefficients, const WarpPolynomial& warp,
            float* values) {
  const int base_x = static_cast<int>(warp[0][0]) - kSampleMargin,
            base_y = static_cast<int>(warp[1][0]) - kSampleMargin;
  const float* data = coefficients.pixels.data();
  const int size = window.Rows();
  for (int j = 0; j < size; ++j) {
    const double dy = j - window.radius;
    std::array<std::array<float, 3>, 2> row{};  // polynomial of x in this row
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const std::array<double, 6>& c = warp[axis];
      const int base = axis == 0 ? base_x : base_y;
      row[axis] = {static_cast<float>(c[0] - base + dy * (c[2] + dy * c[5])),
                   static_cast<float>(c[1] + dy * c[4]), static_cast<float>(c[3])};
    }
    float* out = values + static_cast<std::ptrdiff_t>(j) * window.stride;
    for (int i = 0; i < size; ++i) {
      const float dx = window.offset[static_cast<std::size_t>(i)];
      const float x = row[0][0] + dx * (row[0][1] + dx * row[0][2]);
      const float y = row[1][0] + dx * (row[1][1] + dx * row[1][2]);
      out[i] = SplineAt(data, coefficients.width, base_x, base_y, x, y);
    }
    for (int i = size; i < window.stride; ++i) out[i] = 0;
  }
}

}  // namespace

bool SamplesInside(const SubsetWindow& window, const ImageF& coefficients,
                   const WarpPolynomial& warp) {
  const double reach_x = Reach(warp[0], window.radius), reach_y = Reach(warp[1], window.radius);
  const double x0 = warp[0][0], y0 = warp[1][0];
  return std::max(reach_x, reach_y) < kSampleMargin - 1 && x0 - reach_x >= 2 && y0 - reach_y >= 2 &&
         x0 + reach_x <= coefficients.width - 4 && y0 + reach_y <= coefficients.height - 4;
}

SubsetComparison Compare(const SubsetWindow& window, const ImageF& coefficients,
                         const WarpPolynomial& warp) {
  static const bool avx2 = HasAvx2();
  return avx2 ? CompareAvx2(window, coefficients, warp)
              : CompareBaseline(window, coefficients, warp);
}

SubsetComparison CompareBaseline(const SubsetWindow& window, const ImageF& coefficients,
                                 const WarpPolynomial& warp) {
  SubsetComparison result;
  if (!SamplesInside(window, coefficients, warp)) return result;
  result.inside = true;
  alignas(16) std::array<float, kMaxStride * kMaxStride> values;
  Sample(window, coefficients, warp, values.data());
  const auto total = static_cast<std::size_t>(window.Rows() * window.stride);
  Float4 sum{};
  for (std::size_t k = 0; k < total; k += 4) sum += Load4(&values[k]) * Load4(&window.weight[k]);
  const float mean = Sum4(sum) / window.count;
  Float4 squares{}, product{};
  for (std::size_t k = 0; k < total; k += 4) {
    const Float4 v = (Load4(&values[k]) - mean) * Load4(&window.weight[k]);
    Store4(&values[k], v);
    squares += v * v;
    product += v * Load4(&window.grey[k]);
  }
  const float norm = std::sqrt(Sum4(squares));
  if (!(norm > 0) || !(window.norm > 0)) return result;
  result.zncc = static_cast<double>(Sum4(product)) /
                (static_cast<double>(norm) * static_cast<double>(window.norm));
  const float scale = window.norm / norm;
  Float4 residual2{};
  for (int j = 0; j < window.Rows(); ++j) {
    std::array<Float4, 4> row{};
    for (int i = 0; i < window.stride; i += 4) {
      const auto k = static_cast<std::size_t>(j * window.stride + i);
      const Float4 residual = Load4(&window.grey[k]) - Load4(&values[k]) * scale;
      const Float4 gx = Load4(&window.gradient_x[k]) * residual,
                   gy = Load4(&window.gradient_y[k]) * residual;
      const Float4 x = Load4(&window.offset[static_cast<std::size_t>(i)]);
      residual2 += residual * residual;
      row[0] += gx;
      row[1] += gx * x;
      row[2] += gy;
      row[3] += gy * x;
    }
    const double y = j - window.radius;
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const auto one = static_cast<double>(Sum4(row[2 * axis]));
      result.gradient[3 * axis] += one;
      result.gradient[3 * axis + 1] += static_cast<double>(Sum4(row[2 * axis + 1]));
      result.gradient[3 * axis + 2] += one * y;
    }
  }
  result.squared_residual = static_cast<double>(Sum4(residual2));
  return result;
}

}  // namespace sole::recon
