#pragma once

#include <array>
#include <cstddef>
#include <cstring>

#include "core/image.h"

namespace sole::recon {

inline constexpr int kMaxRadius = 15;
inline constexpr int kMaxStride = 32;  ///< window row, padded to multiples of 8

/// Four floats; the compiler maps them to whatever the processor has.
using Float4 = float __attribute__((vector_size(16)));

inline Float4 Load4(const float* from) {
  Float4 value;
  std::memcpy(&value, from, sizeof value);
  return value;
}
inline void Store4(float* to, Float4 value) {
  std::memcpy(to, &value, sizeof value);
}
inline Float4 All4(float value) {
  return Float4{value, value, value, value};
}
inline float Sum4(Float4 v) {
  return (v[0] + v[2]) + (v[1] + v[3]);
}

/// The four cubic B-spline weights at fraction t.
inline Float4 SplineWeights(float t) {
  constexpr float k = 1.0F / 6.0F;
  constexpr Float4 c0{k, 4 * k, k, 0}, c1{-3 * k, 0, 3 * k, 0}, c2{3 * k, -6 * k, 3 * k, 0},
      c3{-k, 3 * k, -3 * k, k};
  return ((c3 * t + c2) * t + c1) * t + c0;
}

/// Spline value at (base_x + x, base_y + y), which must lie at least 1 pixel from the border and 2
/// from the far one; x and y must not be negative.
inline float SplineAt(const float* coefficients, int stride, int base_x, int base_y, float x,
                      float y) {
  const int ix = static_cast<int>(x), iy = static_cast<int>(y);
  const Float4 wx = SplineWeights(x - static_cast<float>(ix));
  const Float4 wy = SplineWeights(y - static_cast<float>(iy));
  const float* row =
      coefficients + static_cast<std::ptrdiff_t>(base_y + iy - 1) * stride + (base_x + ix - 1);
  const Float4 sum = Load4(row) * wy[0] + Load4(row + stride) * wy[1] +
                     Load4(row + 2 * static_cast<std::ptrdiff_t>(stride)) * wy[2] +
                     Load4(row + 3 * static_cast<std::ptrdiff_t>(stride)) * wy[3];
  return Sum4(sum * wx);
}

/// The reference window: grey levels (zero mean), gradients and weights (0 outside the mask and in
/// the padding), row after row with `stride` floats.
struct SubsetWindow {
  int radius = 0;
  int stride = 0;
  float count = 0;  ///< pixels that take part
  float norm = 0;   ///< root of the sum of squares of `grey`
  alignas(32) std::array<float, kMaxStride * kMaxStride> grey, gradient_x, gradient_y, weight;
  alignas(32) std::array<float, kMaxStride> offset;  ///< x - centre of each column

  int Rows() const { return 2 * radius + 1; }
};

/// Whether a window leaves enough of a border for FillWindow.
inline bool WindowInside(const ImageF& coefficients, int x, int y, int radius) {
  return x - radius >= 1 && y - radius >= 1 && x + radius < coefficients.width - 1 &&
         y + radius < coefficients.height - 2;
}
/// Fills `window` with grey levels and gradients of the spline; WindowInside must hold.
void FillWindow(const ImageF& coefficients, const ImageU8* mask, int x, int y, int radius,
                SubsetWindow& window);

/// Gauss-Newton matrix of the six affine parameters (u, u_x, u_y, v, v_x, v_y), row-major.
std::array<double, 36> NormalMatrix(const SubsetWindow& window);

/// One comparison of the window with the right image under a warp.
struct SubsetComparison {
  bool inside = false;
  double zncc = 0;
  double squared_residual = 0;       ///< of zero-mean left minus normalised right, left grey levels
  std::array<double, 6> gradient{};  ///< sum of steepest-descent image times residual
};
/// A warp's coordinate as a polynomial of the offset: 1, x, y, x x, x y, y y.
using WarpPolynomial = std::array<std::array<double, 6>, 2>;
SubsetComparison Compare(const SubsetWindow& window, const ImageF& coefficients,
                         const WarpPolynomial& warp);

/// Distance by which positions are kept positive, so that floats are good to 1e-5 px.
inline constexpr int kSampleMargin = 64;
/// Whether all samples of a warp lie inside the image.
bool SamplesInside(const SubsetWindow& window, const ImageF& coefficients,
                   const WarpPolynomial& warp);

/// The same comparison for the processor's baseline, and for AVX2 with FMA where that is there.
SubsetComparison CompareBaseline(const SubsetWindow& window, const ImageF& coefficients,
                                 const WarpPolynomial& warp);
bool HasAvx2();
SubsetComparison CompareAvx2(const SubsetWindow& window, const ImageF& coefficients,
                             const WarpPolynomial& warp);

}  // namespace sole::recon
