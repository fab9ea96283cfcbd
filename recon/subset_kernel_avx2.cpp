// Compare for processors with AVX2 and FMA. Plain arrays only, and the instructions are asked for
// function by function: nothing that other files share is compiled for more than the baseline.
#include "recon/subset_kernel_internal.h"

#if defined(__x86_64__)

#include <immintrin.h>

#include <cmath>

#define SOLE_AVX2 [[gnu::target("avx2,fma")]]
#define SOLE_AVX2_INLINE [[gnu::target("avx2,fma"), gnu::always_inline]] inline

namespace sole::recon {
namespace {

SOLE_AVX2_INLINE float Sum8(__m256 v) {
  const __m128 half = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
  const __m128 pair = _mm_add_ps(half, _mm_movehl_ps(half, half));
  return _mm_cvtss_f32(_mm_add_ss(pair, _mm_movehdup_ps(pair)));
}

/// The four cubic B-spline weights of eight fractions, turned so that taps[k] holds the weights of
/// fraction k in its lower half and of fraction k + 4 in its upper half.
SOLE_AVX2_INLINE void Weights(__m256 t, __m256 taps[4]) {
  const __m256 sixth = _mm256_set1_ps(1.0F / 6), one = _mm256_set1_ps(1);
  const __m256 s = _mm256_sub_ps(one, t);
  const __m256 tt = _mm256_mul_ps(t, t);
  const __m256 w0 = _mm256_mul_ps(_mm256_mul_ps(sixth, s), _mm256_mul_ps(s, s));
  const __m256 w1 = _mm256_fmadd_ps(tt, _mm256_fmsub_ps(_mm256_set1_ps(0.5F), t, one),
                                    _mm256_set1_ps(2.0F / 3));
  const __m256 w3 = _mm256_mul_ps(_mm256_mul_ps(sixth, t), tt);
  const __m256 w2 = _mm256_sub_ps(_mm256_sub_ps(one, w0), _mm256_add_ps(w1, w3));
  const __m256 low01 = _mm256_unpacklo_ps(w0, w1), high01 = _mm256_unpackhi_ps(w0, w1);
  const __m256 low23 = _mm256_unpacklo_ps(w2, w3), high23 = _mm256_unpackhi_ps(w2, w3);
  taps[0] = _mm256_shuffle_ps(low01, low23, 0x44);
  taps[1] = _mm256_shuffle_ps(low01, low23, 0xee);
  taps[2] = _mm256_shuffle_ps(high01, high23, 0x44);
  taps[3] = _mm256_shuffle_ps(high01, high23, 0xee);
}

SOLE_AVX2_INLINE __m256 TwoRows(const float* lower, const float* upper) {
  return _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(lower)), _mm_loadu_ps(upper), 1);
}

/// Columns of spline values of two pixels, weighted in both directions; to be summed by fours.
SOLE_AVX2_INLINE __m256 TwoPixels(const float* lower, const float* upper, std::ptrdiff_t stride,
                                  __m256 x, __m256 y) {
  __m256 sum = _mm256_mul_ps(TwoRows(lower, upper), _mm256_permute_ps(y, 0x00));
  sum = _mm256_fmadd_ps(TwoRows(lower + stride, upper + stride), _mm256_permute_ps(y, 0x55), sum);
  sum = _mm256_fmadd_ps(TwoRows(lower + 2 * stride, upper + 2 * stride),
                        _mm256_permute_ps(y, 0xaa), sum);
  sum = _mm256_fmadd_ps(TwoRows(lower + 3 * stride, upper + 3 * stride),
                        _mm256_permute_ps(y, 0xff), sum);
  return _mm256_mul_ps(sum, x);
}

/// Spline values at eight positions relative to `base`, which points at the tap (-1, -1) of (0, 0).
SOLE_AVX2_INLINE __m256 EightPixels(const float* base, std::ptrdiff_t stride, __m256 x, __m256 y) {
  const __m256i ix = _mm256_cvttps_epi32(x), iy = _mm256_cvttps_epi32(y);
  __m256 wx[4], wy[4];
  Weights(_mm256_sub_ps(x, _mm256_cvtepi32_ps(ix)), wx);
  Weights(_mm256_sub_ps(y, _mm256_cvtepi32_ps(iy)), wy);
  const __m256i place = _mm256_add_epi32(
      _mm256_mullo_epi32(iy, _mm256_set1_epi32(static_cast<int>(stride))), ix);
  alignas(32) int at[8];
  _mm256_store_si256(reinterpret_cast<__m256i*>(at), place);
  const __m256 a = TwoPixels(base + at[0], base + at[4], stride, wx[0], wy[0]);
  const __m256 b = TwoPixels(base + at[1], base + at[5], stride, wx[1], wy[1]);
  const __m256 c = TwoPixels(base + at[2], base + at[6], stride, wx[2], wy[2]);
  const __m256 d = TwoPixels(base + at[3], base + at[7], stride, wx[3], wy[3]);
  return _mm256_hadd_ps(_mm256_hadd_ps(a, b), _mm256_hadd_ps(c, d));
}

/// Reads the right image under the warp into `values`, times the weights; returns their sum.
SOLE_AVX2_INLINE float Sample(const SubsetWindow& window, const ImageF& coefficients,
                              const WarpPolynomial& warp, float* values) {
  const int base_x = static_cast<int>(warp[0][0]) - kSampleMargin,
            base_y = static_cast<int>(warp[1][0]) - kSampleMargin;
  const std::ptrdiff_t stride = coefficients.width;
  const float* base = coefficients.pixels.data() + (base_y - 1) * stride + (base_x - 1);
  __m256 sum = _mm256_setzero_ps();
  for (int j = 0; j < window.Rows(); ++j) {
    const double dy = j - window.radius;
    const auto at_row = [&](std::size_t axis, int from) {
      return static_cast<float>(warp[axis][0] - from + dy * (warp[axis][2] + dy * warp[axis][5]));
    };
    const __m256 x0 = _mm256_set1_ps(at_row(0, base_x)), y0 = _mm256_set1_ps(at_row(1, base_y));
    const __m256 x1 = _mm256_set1_ps(static_cast<float>(warp[0][1] + dy * warp[0][4]));
    const __m256 y1 = _mm256_set1_ps(static_cast<float>(warp[1][1] + dy * warp[1][4]));
    const __m256 x2 = _mm256_set1_ps(static_cast<float>(warp[0][3]));
    const __m256 y2 = _mm256_set1_ps(static_cast<float>(warp[1][3]));
    for (int i = 0; i < window.stride; i += 8) {
      const auto k = static_cast<std::size_t>(j * window.stride + i);
      const __m256 dx = _mm256_load_ps(&window.offset[static_cast<std::size_t>(i)]);
      const __m256 x = _mm256_fmadd_ps(dx, _mm256_fmadd_ps(dx, x2, x1), x0);
      const __m256 y = _mm256_fmadd_ps(dx, _mm256_fmadd_ps(dx, y2, y1), y0);
      const __m256 value = _mm256_mul_ps(EightPixels(base, stride, x, y),
                                         _mm256_load_ps(&window.weight[k]));
      _mm256_store_ps(values + k, value);
      sum = _mm256_add_ps(sum, value);
    }
  }
  return Sum8(sum);
}

}  // namespace

bool HasAvx2() {
  __builtin_cpu_init();
  return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
}

SOLE_AVX2 SubsetComparison CompareAvx2(const SubsetWindow& window, const ImageF& coefficients,
                                       const WarpPolynomial& warp) {
  SubsetComparison result;
  if (!SamplesInside(window, coefficients, warp)) return result;
  result.inside = true;
  alignas(32) float values[kMaxStride * kMaxStride];
  const __m256 mean =
      _mm256_set1_ps(Sample(window, coefficients, warp, values) / window.count);
  const auto total = static_cast<std::size_t>(window.Rows() * window.stride);
  __m256 squares = _mm256_setzero_ps(), product = _mm256_setzero_ps();
  for (std::size_t k = 0; k < total; k += 8) {
    const __m256 v =
        _mm256_fnmadd_ps(mean, _mm256_load_ps(&window.weight[k]), _mm256_load_ps(values + k));
    _mm256_store_ps(values + k, v);
    squares = _mm256_fmadd_ps(v, v, squares);
    product = _mm256_fmadd_ps(v, _mm256_load_ps(&window.grey[k]), product);
  }
  const float norm = std::sqrt(Sum8(squares));
  if (!(norm > 0) || !(window.norm > 0)) return result;
  result.zncc = static_cast<double>(Sum8(product)) /
                (static_cast<double>(norm) * static_cast<double>(window.norm));
  const __m256 scale = _mm256_set1_ps(window.norm / norm);
  // Sums of gx r and gy r times 1, x, y over all rows; y is the row's own.
  __m256 squared = _mm256_setzero_ps(), sums[6];
  for (__m256& sum : sums) sum = _mm256_setzero_ps();
  for (int j = 0; j < window.Rows(); ++j) {
    __m256 row_x = _mm256_setzero_ps(), row_y = _mm256_setzero_ps();
    for (int i = 0; i < window.stride; i += 8) {
      const auto k = static_cast<std::size_t>(j * window.stride + i);
      const __m256 residual =
          _mm256_fnmadd_ps(_mm256_load_ps(values + k), scale, _mm256_load_ps(&window.grey[k]));
      const __m256 gx = _mm256_mul_ps(_mm256_load_ps(&window.gradient_x[k]), residual);
      const __m256 gy = _mm256_mul_ps(_mm256_load_ps(&window.gradient_y[k]), residual);
      const __m256 dx = _mm256_load_ps(&window.offset[static_cast<std::size_t>(i)]);
      squared = _mm256_fmadd_ps(residual, residual, squared);
      row_x = _mm256_add_ps(row_x, gx);
      row_y = _mm256_add_ps(row_y, gy);
      sums[1] = _mm256_fmadd_ps(gx, dx, sums[1]);
      sums[4] = _mm256_fmadd_ps(gy, dx, sums[4]);
    }
    const __m256 dy = _mm256_set1_ps(static_cast<float>(j - window.radius));
    sums[0] = _mm256_add_ps(sums[0], row_x);
    sums[3] = _mm256_add_ps(sums[3], row_y);
    sums[2] = _mm256_fmadd_ps(row_x, dy, sums[2]);
    sums[5] = _mm256_fmadd_ps(row_y, dy, sums[5]);
  }
  for (std::size_t k = 0; k < 6; ++k) result.gradient[k] = static_cast<double>(Sum8(sums[k]));
  result.squared_residual = static_cast<double>(Sum8(squared));
  return result;
}

}  // namespace sole::recon

#else

namespace sole::recon {

bool HasAvx2() { return false; }

SubsetComparison CompareAvx2(const SubsetWindow& window, const ImageF& coefficients,
                             const WarpPolynomial& warp) {
  return CompareBaseline(window, coefficients, warp);
}

}  // namespace sole::recon

#endif
