#include "model/contact_network.h"

#include <algorithm>
#include <cstddef>

#include "model/pose_features.h"

namespace sole::model {
namespace {

/// Rows of stacked coarse quantities (3N x M) on the variant's vertices.
Eigen::MatrixXd Upsample(const FootModel& model, Variant variant, const Eigen::MatrixXd& coarse) {
  if (variant == Variant::kCoarse) return coarse;
  Eigen::MatrixXd fine = Eigen::MatrixXd::Zero(3 * model.fine.NumVertices(), coarse.cols());
  for (std::size_t i = 0; i < model.upsampling.size(); ++i) {
    for (const auto& [vertex, weight] : model.upsampling[i]) {
      fine.middleRows<3>(3 * static_cast<Eigen::Index>(i)) +=
          weight * coarse.middleRows<3>(3 * vertex);
    }
  }
  return fine;
}

}  // namespace

Eigen::Index NumNetworkInputs(Eigen::Index num_joints, Eigen::Index num_vertices) {
  return 4 * num_joints + kNetworkBetas + num_vertices;
}

Eigen::VectorXd NetworkInput(const Eigen::MatrixX3d& theta, const Eigen::VectorXd& beta,
                             const Eigen::VectorXd& contact, Eigen::Index num_vertices) {
  const Eigen::Index features = 4 * theta.rows(), betas = std::min(kNetworkBetas, beta.size());
  Eigen::VectorXd input = Eigen::VectorXd::Zero(NumNetworkInputs(theta.rows(), num_vertices));
  input.head(features) = QuaternionFeatures(theta);
  input.segment(features, betas) = beta.head(betas);
  input.segment(features + kNetworkBetas, contact.size()) = contact;
  return input;
}

Eigen::VectorXd EvaluateNetwork(std::span<const NetworkLayer> layers,
                                const Eigen::VectorXd& input) {
  Eigen::VectorXd value = input;
  for (std::size_t l = 0; l < layers.size(); ++l) {
    value = layers[l].weight * value + layers[l].bias;
    if (l + 1 < layers.size()) value = value.cwiseMax(kNetworkSlope * value);
  }
  return value;
}

Eigen::MatrixXd NetworkDerivative(std::span<const NetworkLayer> layers,
                                  const Eigen::VectorXd& input, const Eigen::MatrixXd& directions) {
  Eigen::VectorXd value = input;
  Eigen::MatrixXd derivative = directions;
  for (std::size_t l = 0; l < layers.size(); ++l) {
    value = layers[l].weight * value + layers[l].bias;
    derivative = layers[l].weight * derivative;
    if (l + 1 == layers.size()) break;
    for (Eigen::Index i = 0; i < value.size(); ++i) {
      if (value[i] >= 0) continue;
      value[i] *= kNetworkSlope;
      derivative.row(i) *= kNetworkSlope;
    }
  }
  return derivative;
}

Eigen::VectorXd ContactOffsets(const FootModel& model, Variant variant,
                               const Eigen::MatrixX3d& theta, const Eigen::VectorXd& beta,
                               const Eigen::VectorXd& contact) {
  if (model.network.empty()) return {};
  const Eigen::VectorXd input = NetworkInput(theta, beta, contact, model.NumVertices());
  return Upsample(model, variant, EvaluateNetwork(model.network, input));
}

Eigen::MatrixXd ContactOffsetsJacobian(const FootModel& model, Variant variant,
                                       const Eigen::MatrixX3d& theta, const Eigen::VectorXd& beta,
                                       const Eigen::VectorXd& contact) {
  if (model.network.empty()) return {};
  const Eigen::Index joints = theta.rows(), betas = std::min(kNetworkBetas, beta.size());
  const Eigen::VectorXd input = NetworkInput(theta, beta, contact, model.NumVertices());
  Eigen::MatrixXd directions = Eigen::MatrixXd::Zero(input.size(), 3 * joints + betas);
  for (Eigen::Index j = 0; j < joints; ++j)
    directions.block<4, 3>(4 * j, 3 * j) = QuaternionFeatureJacobian(theta.row(j));
  for (Eigen::Index b = 0; b < betas; ++b) directions(4 * joints + b, 3 * joints + b) = 1;
  return Upsample(model, variant, NetworkDerivative(model.network, input, directions));
}

}  // namespace sole::model
