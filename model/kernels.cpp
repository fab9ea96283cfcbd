#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <cstring>
#include <vector>

#include "model/kernels_internal.h"

// Every loop stands once, in kernels_body_internal.h, and is compiled for the processor's baseline,
// for AVX2 with FMA, and for AVX-512.

namespace sole::model {
namespace {

using Index = std::ptrdiff_t;

template <class Scalar, int kBytes>
struct VectorOf {
  typedef Scalar Type __attribute__((vector_size(kBytes)));
};

using Vector4 = VectorOf<double, 32>::Type;

namespace baseline {
#define SOLE_TARGET
#include "model/kernels_body_internal.h"
#undef SOLE_TARGET
}  // namespace baseline

enum class Level { kBaseline, kAvx2, kAvx512 };

#if defined(__x86_64__)
namespace avx2 {
#define SOLE_TARGET [[gnu::target("avx2,fma")]]
#include "model/kernels_body_internal.h"
#undef SOLE_TARGET
}  // namespace avx2
namespace avx512 {
#define SOLE_TARGET [[gnu::target("avx512f,avx512vl,avx512dq,avx2,fma,prefer-vector-width=512")]]
#define SOLE_WIDEN_EIGHT _mm512_cvtps_pd
#include "model/kernels_body_internal.h"
#undef SOLE_WIDEN_EIGHT
#undef SOLE_TARGET
}  // namespace avx512

Level ThisProcessor() {
  static const Level level = [] {
    __builtin_cpu_init();
    if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return Level::kBaseline;
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
                   __builtin_cpu_supports("avx512dq")
               ? Level::kAvx512
               : Level::kAvx2;
  }();
  return level;
}
#else
namespace avx2 = baseline;
namespace avx512 = baseline;
Level ThisProcessor() { return Level::kBaseline; }
#endif

}  // namespace

template <class Scalar>
void AddProduct(const ProductTerms<Scalar>& terms) {
  thread_local std::vector<Scalar> workspace;
  constexpr std::size_t kLargestHeight = 128 / sizeof(Scalar), kMostColumns = 8;
  workspace.resize(std::max(
      workspace.size(), (kLargestHeight + kMostColumns) * static_cast<std::size_t>(terms.inner)));
  switch (ThisProcessor()) {
    case Level::kAvx512:
      return avx512::ProductBody<Scalar, 64, 8>(terms, workspace.data());
    case Level::kAvx2:
      return avx2::ProductBody<Scalar, 32, 4>(terms, workspace.data());
    case Level::kBaseline:
      return baseline::ProductBody<Scalar, 16, 4>(terms, workspace.data());
  }
}
template void AddProduct(const ProductTerms<double>& terms);
template void AddProduct(const ProductTerms<float>& terms);

template <class Scalar>
void Skin(const SkinTerms<Scalar>& terms) {
  switch (ThisProcessor()) {
    case Level::kAvx512:
      return avx512::SkinBody(terms);
    case Level::kAvx2:
      return avx2::SkinBody(terms);
    case Level::kBaseline:
      return baseline::SkinBody(terms);
  }
}
template void Skin(const SkinTerms<double>& terms);
template void Skin(const SkinTerms<float>& terms);

void DifferentiateVertices(const VertexDerivativeTerms& terms, std::ptrdiff_t first,
                           std::ptrdiff_t count, double* jacobian, double* positions) {
  switch (ThisProcessor()) {
    case Level::kAvx512:
      return avx512::DifferentiateBody<64>(terms, first, count, jacobian, positions);
    case Level::kAvx2:
      return avx2::DifferentiateBody<32>(terms, first, count, jacobian, positions);
    case Level::kBaseline:
      return baseline::DifferentiateBody<32>(terms, first, count, jacobian, positions);
  }
}

}  // namespace sole::model
