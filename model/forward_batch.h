#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "model/forward.h"

namespace sole::model {

template <class Scalar>
using MatrixOf = Eigen::Matrix<Scalar, Eigen::Dynamic, Eigen::Dynamic>;

/// One variant of a model laid out for batches. Scalar: float (1e-6 m) or double. Refers to the
/// model, which must outlive it.
template <class Scalar>
struct BatchModel {
  const FootModel* model = nullptr;
  Variant variant = Variant::kCoarse;
  MatrixOf<Scalar> template_m;            ///< 3N x 1
  MatrixOf<Scalar> blend;                 ///< 3N x (B + P): shapedirs, then posedirs
  std::vector<MatrixOf<Scalar>> weights;  ///< of the network's layers
  std::vector<MatrixOf<Scalar>> biases;   ///< one column each
};

/// `model` must be prepared (see Prepare).
template <class Scalar>
BatchModel<Scalar> PrepareBatch(const FootModel& model, Variant variant = Variant::kCoarse);

/// One column per set of parameters; x, y, z of the points one after another.
template <class Scalar>
struct PosedBatch {
  MatrixOf<Scalar> vertices_m;  ///< 3N x M
  MatrixOf<Scalar> joints_m;    ///< 3K x M
};

/// Forward of M sets of parameters: one matrix product for the blend shapes and one per layer of
/// the network, in chunks on all threads. Throws Error where a set does not fit the model.
template <class Scalar>
PosedBatch<Scalar> ForwardBatch(const BatchModel<Scalar>& batch,
                                std::span<const ModelParameters> parameters);

/// The same in double precision, for a model that is not evaluated again.
PosedBatch<double> ForwardBatch(const FootModel& model, std::span<const ModelParameters> parameters,
                                Variant variant = Variant::kCoarse);

}  // namespace sole::model
