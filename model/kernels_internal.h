#pragma once

#include <cstddef>

// Inner loops on plain arrays, compiled for several vector widths; the widest that the processor
// knows runs. No Eigen type crosses these functions, so its alignment stays that of the baseline.

namespace sole::model {

/// c += a b; all column-major, a rows x inner, b inner x columns, strides between columns. A factor
/// that is also given in single precision is read from there: half as much memory, which is what
/// large matrices times few columns wait for.
template <class Scalar>
struct ProductTerms {
  std::ptrdiff_t rows, columns, inner;
  const Scalar* a;
  std::ptrdiff_t a_stride;
  const Scalar* b;
  std::ptrdiff_t b_stride;
  Scalar* c;
  std::ptrdiff_t c_stride;
  const float* a_single = nullptr;  ///< strides as of a and b
  const float* b_single = nullptr;
};
template <class Scalar>
void AddProduct(const ProductTerms<Scalar>& terms);

/// Linear blend skinning of `count` points, 3 values each. `transforms`: 16 values a joint, the
/// columns of rotation and offset, each followed by one zero.
template <class Scalar>
struct SkinTerms {
  std::ptrdiff_t count;
  const int* start;  ///< count + 1: the entries of a vertex in joint and weight
  const int* joint;
  const double* weight;
  const Scalar* transforms;
  const Scalar* translation;  ///< 3
  const Scalar* rest;
  Scalar* posed;
};
template <class Scalar>
void Skin(const SkinTerms<Scalar>& terms);

/// Vertices whose derivatives before skinning are computed together.
inline constexpr std::ptrdiff_t kVertexBlock = 8;

/// What the derivative of a vertex is made of; K joints, B' shape coefficients. Vectors of four are
/// (x, y, z, 0).
struct VertexDerivativeTerms {
  std::ptrdiff_t joints, betas;
  const int* parents;
  const int* start;  ///< skinning, as SkinTerms
  const int* joint;
  const double* weight;
  const double* transforms;
  const double* translation;     ///< 3
  const double* centres;         ///< K x (x, y, z, 1), posed joints
  const double* turns;           ///< K x 3 values of theta x 3 columns of their cross product x 4
  const double* offset_by_beta;  ///< K x B' x 4
  std::ptrdiff_t rows;           ///< 3 N, stride of the blend shapes' columns
  const double* rest;            ///< 3 N
  const double* shapedirs;
  const double* posedirs;         ///< null: no correctives
  const float* shapedirs_single;  ///< both in single precision, read instead where `single`
  const float* posedirs_single;
  bool single;
  const unsigned char* corrected;        ///< N x K
  std::ptrdiff_t first_feature_joint;    ///< 1 where the root has no feature
  std::ptrdiff_t joint_features;         ///< 4 or 9
  const double* feature_derivative;      ///< K x features x 3
  std::ptrdiff_t beta_feature;           ///< column of posedirs that multiplies beta_2, or -1
  std::ptrdiff_t latent;                 ///< width of the network's factors, 0: no network
  std::ptrdiff_t network_columns;        ///< leading columns of the derivative that it touches
  const double* network_outer;           ///< 3 N x latent
  const double* network_inner;           ///< latent x network_columns
  double* moments;                       ///< workspace, 4 K
  double* block;                         ///< workspace, 3 kVertexBlock (3 K + B')
  double* columns;                       ///< workspace, 4 (3 K + B' + 3) rounded up to 16
};

/// Derivatives of `count` vertices in theta, beta and translation, each to three consecutive rows of
/// 3 K + B' + 3 values; their positions, 3 values each. Fastest for kVertexBlock vertices and more.
void DifferentiateVertices(const VertexDerivativeTerms& terms, std::ptrdiff_t first,
                           std::ptrdiff_t count, double* jacobian, double* positions);

}  // namespace sole::model
