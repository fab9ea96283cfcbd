#include <algorithm>
#include <cstring>
#include <vector>

#include "model/kernels_internal.h"

// Every loop is written once, always inlined, with the vector's width as a template argument, and
// instantiated for the processor's baseline, for AVX2 with FMA, and for AVX-512.

namespace sole::model {
namespace {

using Index = std::ptrdiff_t;

template <class Scalar, int kBytes>
struct VectorOf {
  typedef Scalar Type __attribute__((vector_size(kBytes)));
};

#define SOLE_INLINE [[gnu::always_inline]] inline

template <class Vector, class Scalar>
SOLE_INLINE void Load(Vector& v, const Scalar* from) {
  __builtin_memcpy(&v, from, sizeof(Vector));
}

template <class Vector, class Scalar>
SOLE_INLINE void Store(const Vector& v, Scalar* to) {
  __builtin_memcpy(to, &v, sizeof(Vector));
}

/// c += a b for one column: up to eight columns of `a` at a time, those times zero left out.
template <class Scalar, int kBytes>
SOLE_INLINE void AddColumn(const ProductTerms<Scalar>& t, const Scalar* b, Scalar* c) {
  using Vector = typename VectorOf<Scalar, kBytes>::Type;
  constexpr Index kWidth = kBytes / static_cast<Index>(sizeof(Scalar));
  Index next = 0;
  while (next < t.inner) {
    const Scalar* a[8];
    Scalar x[8];
    int used = 0;
    for (; next < t.inner && used < 8; ++next) {
      if (b[next] == 0) continue;
      a[used] = t.a + next * t.a_stride;
      x[used++] = b[next];
    }
    Index r = 0;
    if (used == 8) {
      for (; r + kWidth <= t.rows; r += kWidth) {
        Vector sum, other, v;
        Load(sum, c + r);
        Load(v, a[0] + r);
        other = v * x[0];
        for (int e = 2; e < 8; e += 2) {
          Load(v, a[e] + r);
          other += v * x[e];
        }
        for (int e = 1; e < 8; e += 2) {
          Load(v, a[e] + r);
          sum += v * x[e];
        }
        sum += other;
        Store(sum, c + r);
      }
    } else {
      for (; r + kWidth <= t.rows; r += kWidth) {
        Vector sum, v;
        Load(sum, c + r);
        for (int e = 0; e < used; ++e) {
          Load(v, a[e] + r);
          sum += v * x[e];
        }
        Store(sum, c + r);
      }
    }
    for (; r < t.rows; ++r) {
      Scalar sum = c[r];
      for (int e = 0; e < used; ++e) sum += a[e][r] * x[e];
      c[r] = sum;
    }
  }
}

/// Two vectors of rows times `kColumns` columns; `a` packed, `height` rows of it real.
template <class Scalar, int kBytes, int kColumns>
SOLE_INLINE void AddTile(const ProductTerms<Scalar>& t, const Scalar* a, const Scalar* b, Scalar* c,
                         Index height) {
  using Vector = typename VectorOf<Scalar, kBytes>::Type;
  constexpr Index kWidth = kBytes / static_cast<Index>(sizeof(Scalar));
  Vector sums[2][kColumns];
  for (int j = 0; j < kColumns; ++j) sums[0][j] = sums[1][j] = Vector{};
  for (Index k = 0; k < t.inner; ++k) {
    Vector low, high;
    Load(low, a + 2 * kWidth * k);
    Load(high, a + 2 * kWidth * k + kWidth);
#pragma GCC unroll 8
    for (int j = 0; j < kColumns; ++j) {
      const Scalar x = b[j * t.b_stride + k];
      sums[0][j] += low * x;
      sums[1][j] += high * x;
    }
  }
#pragma GCC unroll 8
  for (int j = 0; j < kColumns; ++j) {
    Scalar* to = c + j * t.c_stride;
    if (height == 2 * kWidth) {
      Vector v;
      Load(v, to);
      v += sums[0][j];
      Store(v, to);
      Load(v, to + kWidth);
      v += sums[1][j];
      Store(v, to + kWidth);
    } else {
      Scalar sum[2 * kWidth];
      Store(sums[0][j], sum);
      Store(sums[1][j], sum + kWidth);
      for (Index r = 0; r < height; ++r) to[r] += sum[r];
    }
  }
}

template <class Scalar, int kBytes, int kColumns>
SOLE_INLINE void ProductBody(const ProductTerms<Scalar>& t, Scalar* packed) {
  if (t.columns == 1) {
    AddColumn<Scalar, kBytes>(t, t.b, t.c);
    return;
  }
  constexpr Index kHeight = 2 * kBytes / static_cast<Index>(sizeof(Scalar));
  for (Index r = 0; r < t.rows; r += kHeight) {
    const Index height = std::min(kHeight, t.rows - r);
    for (Index k = 0; k < t.inner; ++k) {
      const Scalar* from = t.a + k * t.a_stride + r;
      for (Index i = 0; i < kHeight; ++i) packed[k * kHeight + i] = i < height ? from[i] : 0;
    }
    Index j = 0;
    for (; j + kColumns <= t.columns; j += kColumns)
      AddTile<Scalar, kBytes, kColumns>(t, packed, t.b + j * t.b_stride, t.c + j * t.c_stride + r,
                                        height);
    for (; j < t.columns; ++j)
      AddTile<Scalar, kBytes, 1>(t, packed, t.b + j * t.b_stride, t.c + j * t.c_stride + r, height);
  }
}

template <class Scalar>
SOLE_INLINE void SkinBody(const SkinTerms<Scalar>& t) {
  using Vector = typename VectorOf<Scalar, 4 * sizeof(Scalar)>::Type;
  for (Index i = 0; i < t.count; ++i) {
    Vector x{}, y{}, z{}, sum{t.translation[0], t.translation[1], t.translation[2], 0};
    for (int e = t.start[i]; e < t.start[i + 1]; ++e) {
      const Scalar* from = t.transforms + 16 * t.joint[e];
      const Scalar weight = static_cast<Scalar>(t.weight[e]);
      Vector column;
      Load(column, from);
      x += column * weight;
      Load(column, from + 4);
      y += column * weight;
      Load(column, from + 8);
      z += column * weight;
      Load(column, from + 12);
      sum += column * weight;
    }
    sum += x * t.rest[3 * i] + y * t.rest[3 * i + 1] + z * t.rest[3 * i + 2];
    for (int axis = 0; axis < 3; ++axis) t.posed[3 * i + axis] = sum[axis];
  }
}

using Vector4 = VectorOf<double, 32>::Type;

/// x a + y b + z c.
SOLE_INLINE void Combine(Vector4& out, const Vector4* columns, double x, double y, double z) {
  out += columns[0] * x + columns[1] * y + columns[2] * z;
}

SOLE_INLINE void AddTurnsAndFeatures(const VertexDerivativeTerms& t, Index i,
                                     const Vector4* blended) {
  for (Index j = 0; j < t.joints; ++j) {
    Vector4 out[3] = {Vector4{}, Vector4{}, Vector4{}}, moment, centre;
    Load(moment, t.moments + 4 * j);
    if (moment[3] != 0) {
      Load(centre, t.centres + 4 * j);
      const Vector4 arm = moment - centre * moment[3];
      for (int c = 0; c < 3; ++c) {
        Vector4 cross[3];
        for (int a = 0; a < 3; ++a) Load(cross[a], t.turns + 36 * j + 12 * c + 4 * a);
        Combine(out[c], cross, arm[0], arm[1], arm[2]);
      }
    }
    if (t.posedirs != nullptr && t.corrected[i * t.joints + j] != 0) {
      const double* direction =
          t.posedirs + (j - t.first_feature_joint) * t.joint_features * t.rows + 3 * i;
      const double* factor = t.feature_derivative + 3 * t.joint_features * j;
      for (Index f = 0; f < t.joint_features; ++f, direction += t.rows, factor += 3) {
        Vector4 turned{};
        Combine(turned, blended, direction[0], direction[1], direction[2]);
        for (int c = 0; c < 3; ++c) out[c] += turned * factor[c];
      }
    }
    for (int c = 0; c < 3; ++c) Store(out[c], t.columns + 4 * (3 * j + c));
  }
}

SOLE_INLINE void AddBetas(const VertexDerivativeTerms& t, Index i, const Vector4* blended) {
  for (Index b = 0; b < t.betas; ++b) {
    Vector4 out{}, share;
    const double* direction = t.shapedirs + b * t.rows + 3 * i;
    Combine(out, blended, direction[0], direction[1], direction[2]);
    for (int e = t.start[i]; e < t.start[i + 1]; ++e) {
      Load(share, t.offset_by_beta + 4 * (t.joint[e] * t.betas + b));
      out += share * t.weight[e];
    }
    if (b == 1 && t.beta_feature >= 0) {
      direction = t.posedirs + t.beta_feature * t.rows + 3 * i;
      Combine(out, blended, direction[0], direction[1], direction[2]);
    }
    Store(out, t.columns + 4 * (3 * t.joints + b));
  }
}

SOLE_INLINE void AddNetwork(const VertexDerivativeTerms& t, Index i, const Vector4* blended) {
  for (Index l = 0; l < t.latent; ++l) {
    const double* direction = t.network_outer + l * t.rows + 3 * i;
    Vector4 turned{};
    Combine(turned, blended, direction[0], direction[1], direction[2]);
    Store(turned, t.turned + 4 * l);
  }
  Index c = 0;
  for (; c + 4 <= t.network_columns; c += 4) {
    Vector4 sums[4], turned;
    for (int s = 0; s < 4; ++s) Load(sums[s], t.columns + 4 * (c + s));
    const double* inner = t.network_inner + c * t.latent;
    for (Index l = 0; l < t.latent; ++l) {
      Load(turned, t.turned + 4 * l);
#pragma GCC unroll 4
      for (int s = 0; s < 4; ++s) sums[s] += turned * inner[s * t.latent + l];
    }
    for (int s = 0; s < 4; ++s) Store(sums[s], t.columns + 4 * (c + s));
  }
  for (; c < t.network_columns; ++c) {
    Vector4 sum, turned;
    Load(sum, t.columns + 4 * c);
    for (Index l = 0; l < t.latent; ++l) {
      Load(turned, t.turned + 4 * l);
      sum += turned * t.network_inner[c * t.latent + l];
    }
    Store(sum, t.columns + 4 * c);
  }
}

/// The columns, four by four, to the three rows of the Jacobian.
SOLE_INLINE void Transpose(const double* columns, Index count, double* rows) {
  using Mask = VectorOf<long long, 32>::Type;
  Index c = 0;
  for (; c + 4 <= count; c += 4) {
    Vector4 v[4];
    for (int e = 0; e < 4; ++e) Load(v[e], columns + 4 * (c + e));
    const Vector4 xy0 = __builtin_shuffle(v[0], v[1], Mask{0, 4, 1, 5}),
                  xy2 = __builtin_shuffle(v[2], v[3], Mask{0, 4, 1, 5}),
                  z0 = __builtin_shuffle(v[0], v[1], Mask{2, 6, 3, 7}),
                  z2 = __builtin_shuffle(v[2], v[3], Mask{2, 6, 3, 7});
    Store(__builtin_shuffle(xy0, xy2, Mask{0, 1, 4, 5}), rows + c);
    Store(__builtin_shuffle(xy0, xy2, Mask{2, 3, 6, 7}), rows + count + c);
    Store(__builtin_shuffle(z0, z2, Mask{0, 1, 4, 5}), rows + 2 * count + c);
  }
  for (; c < count; ++c)
    for (int axis = 0; axis < 3; ++axis) rows[axis * count + c] = columns[4 * c + axis];
}

SOLE_INLINE void DifferentiateBody(const VertexDerivativeTerms& t, Index i, double* jacobian,
                                   double* position) {
  std::memset(t.moments, 0, sizeof(double) * static_cast<std::size_t>(4 * t.joints));
  Vector4 blended[3] = {Vector4{}, Vector4{}, Vector4{}};
  const double* rest = t.rest + 3 * i;
  for (int e = t.start[i]; e < t.start[i + 1]; ++e) {
    const double* from = t.transforms + 16 * t.joint[e];
    const double weight = t.weight[e];
    Vector4 columns[3], moved;
    for (int a = 0; a < 3; ++a) {
      Load(columns[a], from + 4 * a);
      blended[a] += columns[a] * weight;
    }
    Load(moved, from + 12);
    Combine(moved, columns, rest[0], rest[1], rest[2]);
    moved *= weight;
    moved[3] = weight;
    Store(moved, t.moments + 4 * t.joint[e]);
  }
  // Each bone's share goes to its ancestors too: a joint turns all that hangs below it.
  for (Index j = t.joints; j-- > 1;) {
    Vector4 own, above;
    Load(own, t.moments + 4 * j);
    Load(above, t.moments + 4 * t.parents[j]);
    above += own;
    Store(above, t.moments + 4 * t.parents[j]);
  }
  for (int axis = 0; axis < 3; ++axis) position[axis] = t.moments[axis] + t.translation[axis];
  AddTurnsAndFeatures(t, i, blended);
  AddBetas(t, i, blended);
  if (t.latent > 0) AddNetwork(t, i, blended);
  const Index shifts = 3 * t.joints + t.betas;
  for (int axis = 0; axis < 3; ++axis) {
    double* column = t.columns + 4 * (shifts + axis);
    for (int a = 0; a < 4; ++a) column[a] = a == axis ? 1 : 0;
  }
  Transpose(t.columns, shifts + 3, jacobian);
}

#if defined(__x86_64__)
#define SOLE_AVX2 [[gnu::target("avx2,fma")]]
#define SOLE_AVX512 [[gnu::target("avx512f,avx512vl,avx512dq,avx2,fma,prefer-vector-width=512")]]
enum class Level { kBaseline, kAvx2, kAvx512 };
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
#define SOLE_AVX2
#define SOLE_AVX512
enum class Level { kBaseline, kAvx2, kAvx512 };
Level ThisProcessor() { return Level::kBaseline; }
#endif

template <class Scalar>
void Product128(const ProductTerms<Scalar>& t, Scalar* packed) {
  ProductBody<Scalar, 16, 4>(t, packed);
}
template <class Scalar>
SOLE_AVX2 void Product256(const ProductTerms<Scalar>& t, Scalar* packed) {
  ProductBody<Scalar, 32, 4>(t, packed);
}
template <class Scalar>
SOLE_AVX512 void Product512(const ProductTerms<Scalar>& t, Scalar* packed) {
  ProductBody<Scalar, 64, 8>(t, packed);
}

template <class Scalar>
SOLE_AVX2 void SkinAvx2(const SkinTerms<Scalar>& t) {
  SkinBody(t);
}
SOLE_AVX2 void DifferentiateAvx2(const VertexDerivativeTerms& t, Index i, double* jacobian,
                                 double* position) {
  DifferentiateBody(t, i, jacobian, position);
}

}  // namespace

template <class Scalar>
void AddProduct(const ProductTerms<Scalar>& terms) {
  thread_local std::vector<Scalar> packed;
  if (terms.columns > 1) {
    constexpr std::size_t kLargestHeight = 128 / sizeof(Scalar);
    packed.resize(std::max(packed.size(), kLargestHeight * static_cast<std::size_t>(terms.inner)));
  }
  switch (ThisProcessor()) {
    case Level::kAvx512:
      return Product512(terms, packed.data());
    case Level::kAvx2:
      return Product256(terms, packed.data());
    case Level::kBaseline:
      return Product128(terms, packed.data());
  }
}
template void AddProduct(const ProductTerms<double>& terms);
template void AddProduct(const ProductTerms<float>& terms);

template <class Scalar>
void Skin(const SkinTerms<Scalar>& terms) {
  if (ThisProcessor() == Level::kBaseline) return SkinBody(terms);
  SkinAvx2(terms);
}
template void Skin(const SkinTerms<double>& terms);
template void Skin(const SkinTerms<float>& terms);

void DifferentiateVertex(const VertexDerivativeTerms& terms, std::ptrdiff_t i, double* jacobian,
                         double* position) {
  if (ThisProcessor() == Level::kBaseline) return DifferentiateBody(terms, i, jacobian, position);
  DifferentiateAvx2(terms, i, jacobian, position);
}

}  // namespace sole::model
