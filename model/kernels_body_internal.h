// No include guard: kernels.cpp includes this once for every instruction set, in a namespace of its
// own, with SOLE_TARGET naming the instructions. (Inlining common functions into others of a wider
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

/// c += a b for one column: up to eight columns of `a` at a time, those times zero left out.
template <class Scalar, int kBytes>
SOLE_KERNEL inline void AddColumn(const ProductTerms<Scalar>& t, const Scalar* b, Scalar* c) {
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
SOLE_KERNEL inline void AddTile(const ProductTerms<Scalar>& t, const Scalar* a, const Scalar* b,
                                Scalar* c, Index height) {
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
SOLE_ENTRY void ProductBody(const ProductTerms<Scalar>& t, Scalar* packed) {
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

SOLE_KERNEL inline void AddTurnsAndFeatures(const VertexDerivativeTerms& t, Index i,
                                            const Columns& blended) {
  for (Index j = 0; j < t.joints; ++j) {
    Vector4 out0{}, out1{}, out2{}, moment, centre;
    Load(moment, t.moments + 4 * j);
    if (moment[3] != 0) {
      Load(centre, t.centres + 4 * j);
      const Vector4 arm = moment - centre * moment[3];
      AddTurn(t.turns + 36 * j, arm, out0);
      AddTurn(t.turns + 36 * j + 12, arm, out1);
      AddTurn(t.turns + 36 * j + 24, arm, out2);
    }
    if (t.posedirs != nullptr && t.corrected[i * t.joints + j] != 0) {
      const double* direction =
          t.posedirs + (j - t.first_feature_joint) * t.joint_features * t.rows + 3 * i;
      const double* factor = t.feature_derivative + 3 * t.joint_features * j;
      for (Index f = 0; f < t.joint_features; ++f, direction += t.rows, factor += 3) {
        Vector4 turned{};
        Combine(turned, blended, direction);
        out0 += turned * factor[0];
        out1 += turned * factor[1];
        out2 += turned * factor[2];
      }
    }
    Store(out0, t.columns + 12 * j);
    Store(out1, t.columns + 12 * j + 4);
    Store(out2, t.columns + 12 * j + 8);
  }
}

SOLE_KERNEL inline void AddBetas(const VertexDerivativeTerms& t, Index i, const Columns& blended) {
  for (Index b = 0; b < t.betas; ++b) {
    Vector4 out{}, share;
    const double* direction = t.shapedirs + b * t.rows + 3 * i;
    Combine(out, blended, direction);
    for (int e = t.start[i]; e < t.start[i + 1]; ++e) {
      Load(share, t.offset_by_beta + 4 * (t.joint[e] * t.betas + b));
      out += share * t.weight[e];
    }
    if (b == 1 && t.beta_feature >= 0) {
      direction = t.posedirs + t.beta_feature * t.rows + 3 * i;
      Combine(out, blended, direction);
    }
    Store(out, t.columns + 4 * (3 * t.joints + b));
  }
}

SOLE_KERNEL inline void AddNetwork(const VertexDerivativeTerms& t, Index i,
                                   const Columns& blended) {
  for (Index l = 0; l < t.latent; ++l) {
    const double* direction = t.network_outer + l * t.rows + 3 * i;
    Vector4 turned{};
    Combine(turned, blended, direction);
    Store(turned, t.turned + 4 * l);
  }
  Index c = 0;
  for (; c + 4 <= t.network_columns; c += 4) {
    double* to = t.columns + 4 * c;
    Vector4 sum0, sum1, sum2, sum3, turned;
    Load(sum0, to);
    Load(sum1, to + 4);
    Load(sum2, to + 8);
    Load(sum3, to + 12);
    const double* inner = t.network_inner + c * t.latent;
    for (Index l = 0; l < t.latent; ++l, ++inner) {
      Load(turned, t.turned + 4 * l);
      sum0 += turned * inner[0];
      sum1 += turned * inner[t.latent];
      sum2 += turned * inner[2 * t.latent];
      sum3 += turned * inner[3 * t.latent];
    }
    Store(sum0, to);
    Store(sum1, to + 4);
    Store(sum2, to + 8);
    Store(sum3, to + 12);
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

SOLE_ENTRY inline void DifferentiateBody(const VertexDerivativeTerms& t, Index i, double* jacobian,
                                         double* position) {
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

#undef SOLE_ENTRY
#undef SOLE_KERNEL
