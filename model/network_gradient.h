#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "model/foot_model.h"

namespace sole::model {

/// Derivatives of a sum over a batch of network values.
struct NetworkGradient {
  std::vector<NetworkLayer> layers;  ///< in every weight and bias, sizes of the network's
  Eigen::MatrixXd inputs;            ///< in the inputs, one column a member of the batch
};

/// Back-propagation through the network of EvaluateNetwork. Columns of `inputs` (as many rows as
/// the first layer takes) are the members of a batch, `by_values` (3N rows, the same columns) is the
/// derivative of the loss in their values. Throws Error where sizes do not fit.
NetworkGradient BackPropagate(std::span<const NetworkLayer> layers, const Eigen::MatrixXd& inputs,
                              const Eigen::MatrixXd& by_values);

}  // namespace sole::model
