#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "model/foot_model.h"

namespace sole::model {

/// The network of EvaluateNetwork in single precision, all its parameters in one vector: layer by
/// layer the weight (outputs x inputs, column by column), then the bias. Training keeps gradients
/// and moments as vectors of the same order.
struct FloatNetwork {
  std::vector<Eigen::Index> widths;  ///< inputs, then the outputs of every layer
  Eigen::VectorXf parameters;
};

Eigen::Index NumParameters(std::span<const Eigen::Index> widths);

/// Values, one column a member of the batch.
Eigen::MatrixXf EvaluateBatch(const FloatNetwork& network, const Eigen::MatrixXf& inputs);

/// What back-propagation keeps of the way forward: what goes into each layer, and the values.
struct ForwardPass {
  std::vector<Eigen::MatrixXf> into;
  Eigen::MatrixXf values;
};
ForwardPass RunForward(const FloatNetwork& network, const Eigen::MatrixXf& inputs);

/// Gradient of a loss in the parameters, from its derivative in the values (same columns).
Eigen::VectorXf RunBackward(const FloatNetwork& network, const ForwardPass& pass,
                            Eigen::MatrixXf by_values);

/// Layers in double precision, as models hold them.
std::vector<NetworkLayer> LayersOf(const FloatNetwork& network);

}  // namespace sole::model
