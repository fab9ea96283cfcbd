// No include guard: kernels.cpp includes this once for every instruction set, in a namespace of its
// own, with SOLE_TARGET naming the instructions, and SOLE_WIDEN_EIGHT the one from eight floats to
// doubles, for which the compiler by itself takes six. (Inlining common functions into others of a wider
// target would not do: the compiler splits vectors before it inlines.)

#define SOLE_KERNEL SOLE_TARGET [[gnu::always_inline]]
#define SOLE_ENTRY SOLE_TARGET

template <class Vector, class Scalar>
SOLE_KERNEL inline void Load(Vector& v, const Scalar* from) {
  __builtin_memcpy(&v, from, sizeof(Vector));
}

template <class Vector, class Scalar>
SOLE_KERNEL inline void Store(const Vector& v, Scalar* to) {
  __builtin_memcpy(to, &v, sizeof(Vector));
}

/// Single precision into a vector of doubles.
template <class Vector>
SOLE_KERNEL inline void Load(Vector& v, const float* from)
  requires(sizeof(v[0]) == sizeof(double))
{
  typename VectorOf<float, sizeof(Vector) / 2>::Type single;
  __builtin_memcpy(&single, from, sizeof(single));
#ifdef SOLE_WIDEN_EIGHT
  if constexpr (sizeof(Vector) == 64) {
    v = SOLE_WIDEN_EIGHT(single);
    return;
  }
#endif
  v = __builtin_convertvector(single, Vector);
}

/// c += a b for one column: up to eight columns of `a` at a time, those times zero left out.
template <class Scalar, int kBytes, class Given>
SOLE_KERNEL inline void AddColumn(const ProductTerms<Scalar>& t, const Given* columns) {
  using Vector = typename VectorOf<Scalar, kBytes>::Type;
  constexpr Index kWidth = kBytes / static_cast<Index>(sizeof(Scalar));
  const Scalar* b = t.b;
  Scalar* c = t.c;
  Index next = 0;
  while (next < t.inner) {
    const Given* a[8];
    Scalar x[8];
    int used = 0;
    for (; next < t.inner && used < 8; ++next) {
      if (b[next] == 0) continue;
      a[used] = columns + next * t.a_stride;
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
SOLE_KERNEL inline void AddTile(const ProductTerms<Scalar>& t, const Scalar* a, const Scalar* b,
                                Index b_stride, Scalar* c, Index height) {
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
      const Scalar x = b[j * b_stride + k];
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

/// `height` values of each column of `a`, those missing zero; converted where they are given in
/// single precision.
template <class Scalar, int kBytes, class Given>
SOLE_KERNEL inline void Pack(const ProductTerms<Scalar>& t, const Given* from, Index height,
                             Scalar* packed) {
  using Vector = typename VectorOf<Scalar, kBytes>::Type;
  constexpr Index kWidth = kBytes / static_cast<Index>(sizeof(Scalar));
  if (height == 2 * kWidth) {
    for (Index k = 0; k < t.inner; ++k, from += t.a_stride, packed += height) {
      Vector low, high;
      Load(low, from);
      Load(high, from + kWidth);
      Store(low, packed);
      Store(high, packed + kWidth);
    }
    return;
  }
  for (Index k = 0; k < t.inner; ++k, from += t.a_stride, packed += 2 * kWidth) {
    for (Index i = 0; i < height; ++i) packed[i] = from[i];
    for (Index i = height; i < 2 * kWidth; ++i) packed[i] = 0;
  }
}

template <class Scalar, int kBytes>
SOLE_KERNEL inline void Convert(const float* from, Index count, Scalar* to) {
  using Vector = typename VectorOf<Scalar, kBytes>::Type;
  constexpr Index kWidth = kBytes / static_cast<Index>(sizeof(Scalar));
  Index i = 0;
  for (; i + kWidth <= count; i += kWidth) {
    Vector v;
    Load(v, from + i);
    Store(v, to + i);
  }
  for (; i < count; ++i) to[i] = from[i];
}

/// The tiles of some rows, `kColumns` columns at a time, then fewer; `converted` is workspace.
template <class Scalar, int kBytes, int kColumns>
SOLE_KERNEL inline void AddTiles(const ProductTerms<Scalar>& t, const Scalar* a, Index height,
                                 Scalar* c, Index j, Scalar* converted) {
  for (; j + kColumns <= t.columns; j += kColumns) {
    const Scalar* b = t.b + j * t.b_stride;
    Index b_stride = t.b_stride;
    if (t.b_single != nullptr) {
      for (int column = 0; column < kColumns; ++column)
        Convert<Scalar, kBytes>(t.b_single + (j + column) * t.b_stride, t.inner,
                                converted + column * t.inner);
      b = converted;
      b_stride = t.inner;
    }
    AddTile<Scalar, kBytes, kColumns>(t, a, b, b_stride, c + j * t.c_stride, height);
  }
  if constexpr (kColumns > 1) AddTiles<Scalar, kBytes, kColumns / 2>(t, a, height, c, j, converted);
}

template <class Scalar, int kBytes, int kColumns>
SOLE_ENTRY void ProductBody(const ProductTerms<Scalar>& t, Scalar* workspace) {
  if (t.columns == 1 && t.b_single == nullptr) {
    if (t.a_single != nullptr) return AddColumn<Scalar, kBytes>(t, t.a_single);
    return AddColumn<Scalar, kBytes>(t, t.a);
  }
  constexpr Index kHeight = 2 * kBytes / static_cast<Index>(sizeof(Scalar));
  Scalar* packed = workspace;
  Scalar* converted = workspace + kHeight * t.inner;
  for (Index r = 0; r < t.rows; r += kHeight) {
    const Index height = std::min(kHeight, t.rows - r);
    if (t.a_single != nullptr) {
      Pack<Scalar, kBytes>(t, t.a_single + r, height, packed);
    } else {
      Pack<Scalar, kBytes>(t, t.a + r, height, packed);
    }
    AddTiles<Scalar, kBytes, kColumns>(t, packed, height, t.c + r, 0, converted);
  }
}

template <class Scalar>
SOLE_ENTRY void SkinBody(const SkinTerms<Scalar>& t) {
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

/// Named members, no array: an array of vectors would live in memory.
struct Columns {
  Vector4 x, y, z;
};

/// Rows of a block of vertices, one after another in a column.
constexpr Index kBlockVertices = kVertexBlock, kBlockRows = 3 * kBlockVertices;

/// The right factor of a product.
struct Factor {
  const double* values;
  Index inner, inner_stride, column_stride;
};

/// out += columns v.
SOLE_KERNEL inline void Combine(Vector4& out, const Columns& columns, const double* v) {
  out += columns.x * v[0] + columns.y * v[1] + columns.z * v[2];
}

SOLE_KERNEL inline void AddTurn(const double* turn, const Vector4& arm, Vector4& out) {
  Vector4 x, y, z;
  Load(x, turn);
  Load(y, turn + 4);
  Load(z, turn + 8);
  out += x * arm[0] + y * arm[1] + z * arm[2];
}

/// out += a b of some rows, `kColumns` columns of stride kBlockRows; `readable` rows of `a` may be
/// read.
template <int kBytes, int kColumns, class Given>
SOLE_KERNEL inline Index AddRowVectors(const Given* a, Index a_stride, const Factor& b, double* out,
                                       Index r, Index end) {
  using Vector = typename VectorOf<double, kBytes>::Type;
  constexpr Index kWidth = kBytes / static_cast<Index>(sizeof(double));
  for (; r + kWidth <= end; r += kWidth) {
    Vector sums[kColumns];
    for (int c = 0; c < kColumns; ++c) Load(sums[c], out + kBlockRows * c + r);
    const Given* from = a + r;
    const double* factor = b.values;
    for (Index k = 0; k < b.inner; ++k, from += a_stride, factor += b.inner_stride) {
      Vector v;
      Load(v, from);
#pragma GCC unroll 4
      for (int c = 0; c < kColumns; ++c) sums[c] += v * factor[c * b.column_stride];
    }
    for (int c = 0; c < kColumns; ++c) Store(sums[c], out + kBlockRows * c + r);
  }
  return r;
}

template <int kBytes, int kColumns, class Given>
SOLE_KERNEL inline void AddRows(const Given* a, Index a_stride, const Factor& b, double* out,
                                Index rows, Index readable) {
  Index r = AddRowVectors<kBytes, kColumns>(a, a_stride, b, out, 0, rows);
  r = AddRowVectors<32, kColumns>(a, a_stride, b, out, r, std::min(readable, (rows + 3) / 4 * 4));
  for (; r < rows; ++r) {
    for (int c = 0; c < kColumns; ++c) {
      for (Index k = 0; k < b.inner; ++k)
        out[kBlockRows * c + r] +=
            a[k * a_stride + r] * b.values[k * b.inner_stride + c * b.column_stride];
    }
  }
}

/// Derivatives of the unposed vertices first .. first + count in theta and beta, to t.block.
template <int kBytes, class Given>
SOLE_KERNEL inline void DifferentiateRest(const VertexDerivativeTerms& t, const Given* shapedirs,
                                          const Given* posedirs, Index first, Index count) {
  const Index row = 3 * first, rows = 3 * count, readable = t.rows - row, thetas = 3 * t.joints;
  std::memset(t.block, 0,
              sizeof(double) * static_cast<std::size_t>(kBlockRows * (thetas + t.betas)));
  for (Index j = t.first_feature_joint; posedirs != nullptr && j < t.joints; ++j) {
    bool corrected = false;
    for (Index v = 0; v < count; ++v) corrected |= t.corrected[(first + v) * t.joints + j] != 0;
    if (!corrected) continue;
    const Given* directions =
        posedirs + (j - t.first_feature_joint) * t.joint_features * t.rows + row;
    const double* factor = t.feature_derivative + 3 * t.joint_features * j;
    AddRows<kBytes, 3>(directions, t.rows, Factor{factor, t.joint_features, 3, 1},
                       t.block + kBlockRows * 3 * j, rows, readable);
  }
  const double one = 1;
  for (Index b = 0; b < t.betas; ++b) {
    double* to = t.block + kBlockRows * (thetas + b);
    AddRows<kBytes, 1>(shapedirs + b * t.rows + row, t.rows, Factor{&one, 1, 0, 0}, to, rows,
                       readable);
    if (b == 1 && t.beta_feature >= 0)
      AddRows<kBytes, 1>(posedirs + t.beta_feature * t.rows + row, t.rows, Factor{&one, 1, 0, 0},
                         to, rows, readable);
  }
  if (t.latent == 0) return;
  Index c = 0;
  for (; c + 4 <= t.network_columns; c += 4)
    AddRows<kBytes, 4>(t.network_outer + row, t.rows,
                       Factor{t.network_inner + c * t.latent, t.latent, 1, t.latent},
                       t.block + kBlockRows * c, rows, readable);
  for (; c < t.network_columns; ++c)
    AddRows<kBytes, 1>(t.network_outer + row, t.rows,
                       Factor{t.network_inner + c * t.latent, t.latent, 1, t.latent},
                       t.block + kBlockRows * c, rows, readable);
}

/// `block`: the vertex' first column in t.block.
SOLE_KERNEL inline void AddThetas(const VertexDerivativeTerms& t, const double* block,
                                  const Columns& blended) {
  for (Index j = 0; j < t.joints; ++j, block += 3 * kBlockRows) {
    Vector4 out0{}, out1{}, out2{}, moment, centre;
    Combine(out0, blended, block);
    Combine(out1, blended, block + kBlockRows);
    Combine(out2, blended, block + 2 * kBlockRows);
    Load(moment, t.moments + 4 * j);
    if (moment[3] != 0) {
      Load(centre, t.centres + 4 * j);
      const Vector4 arm = moment - centre * moment[3];
      AddTurn(t.turns + 36 * j, arm, out0);
      AddTurn(t.turns + 36 * j + 12, arm, out1);
      AddTurn(t.turns + 36 * j + 24, arm, out2);
    }
    Store(out0, t.columns + 12 * j);
    Store(out1, t.columns + 12 * j + 4);
    Store(out2, t.columns + 12 * j + 8);
  }
}

SOLE_KERNEL inline void AddBetas(const VertexDerivativeTerms& t, Index i, const double* block,
                                 const Columns& blended) {
  block += kBlockRows * 3 * t.joints;
  for (Index b = 0; b < t.betas; ++b, block += kBlockRows) {
    Vector4 out{}, share;
    Combine(out, blended, block);
    for (int e = t.start[i]; e < t.start[i + 1]; ++e) {
      Load(share, t.offset_by_beta + 4 * (t.joint[e] * t.betas + b));
      out += share * t.weight[e];
    }
    Store(out, t.columns + 4 * (3 * t.joints + b));
  }
}

/// The columns, four by four, to the three rows of the Jacobian.
SOLE_KERNEL inline void Transpose(const double* columns, Index count, double* rows) {
  using Mask = VectorOf<long long, 32>::Type;
  Index c = 0;
  for (; c + 4 <= count; c += 4) {
    Vector4 v0, v1, v2, v3;
    Load(v0, columns + 4 * c);
    Load(v1, columns + 4 * c + 4);
    Load(v2, columns + 4 * c + 8);
    Load(v3, columns + 4 * c + 12);
    const Vector4 xy0 = __builtin_shuffle(v0, v1, Mask{0, 4, 1, 5}),
                  xy2 = __builtin_shuffle(v2, v3, Mask{0, 4, 1, 5}),
                  z0 = __builtin_shuffle(v0, v1, Mask{2, 6, 3, 7}),
                  z2 = __builtin_shuffle(v2, v3, Mask{2, 6, 3, 7});
    Store(__builtin_shuffle(xy0, xy2, Mask{0, 1, 4, 5}), rows + c);
    Store(__builtin_shuffle(xy0, xy2, Mask{2, 3, 6, 7}), rows + count + c);
    Store(__builtin_shuffle(z0, z2, Mask{0, 1, 4, 5}), rows + 2 * count + c);
  }
  for (; c < count; ++c)
    for (int axis = 0; axis < 3; ++axis) rows[axis * count + c] = columns[4 * c + axis];
}

/// `block`: the vertex' first column in t.block.
SOLE_KERNEL inline void DifferentiateOne(const VertexDerivativeTerms& t, Index i,
                                         const double* block, double* jacobian, double* position) {
  std::memset(t.moments, 0, sizeof(double) * static_cast<std::size_t>(4 * t.joints));
  Columns blended{};
  const double* rest = t.rest + 3 * i;
  for (int e = t.start[i]; e < t.start[i + 1]; ++e) {
    const double* from = t.transforms + 16 * t.joint[e];
    const double weight = t.weight[e];
    Columns columns;
    Vector4 moved;
    Load(columns.x, from);
    Load(columns.y, from + 4);
    Load(columns.z, from + 8);
    Load(moved, from + 12);
    blended.x += columns.x * weight;
    blended.y += columns.y * weight;
    blended.z += columns.z * weight;
    Combine(moved, columns, rest);
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
  AddThetas(t, block, blended);
  AddBetas(t, i, block, blended);
  const Index shifts = 3 * t.joints + t.betas;
  for (int axis = 0; axis < 3; ++axis) {
    double* column = t.columns + 4 * (shifts + axis);
    for (int a = 0; a < 4; ++a) column[a] = a == axis ? 1 : 0;
  }
  Transpose(t.columns, shifts + 3, jacobian);
}

template <int kBytes>
SOLE_ENTRY void DifferentiateBody(const VertexDerivativeTerms& t, Index first, Index count,
                                  double* jacobian, double* positions) {
  const Index size = 3 * (3 * t.joints + t.betas + 3);
  for (Index done = 0; done < count; done += kBlockVertices) {
    const Index some = std::min(kBlockVertices, count - done);
    if (t.single) {
      DifferentiateRest<kBytes>(t, t.shapedirs_single, t.posedirs_single, first + done, some);
    } else {
      DifferentiateRest<kBytes>(t, t.shapedirs, t.posedirs, first + done, some);
    }
    for (Index v = 0; v < some; ++v) {
      const Index at = done + v;
      DifferentiateOne(t, first + at, t.block + 3 * v, jacobian + at * size, positions + 3 * at);
    }
  }
}

#undef SOLE_ENTRY
#undef SOLE_KERNEL
