#include "model/contact_network.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "core/error.h"
#include "model/kernels_internal.h"
#include "model/pose_features.h"

namespace sole::model {
namespace {

/// Rows of stacked coarse quantities (3N x M) on the variant's vertices.
Eigen::MatrixXd Upsample(const FootModel& model, Variant variant, Eigen::MatrixXd coarse) {
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

NetworkFactors Upsample(const FootModel& model, Variant variant, NetworkFactors factors) {
  factors.value = Upsample(model, variant, std::move(factors.value));
  factors.outer = Upsample(model, variant, std::move(factors.outer));
  return factors;
}

/// A layer's weights, in single precision too where that is exact (null where not).
struct Weights {
  const Eigen::MatrixXd& full;
  const float* single;
};

Weights WeightsOf(std::span<const NetworkLayer> layers, std::span<const Eigen::MatrixXf> single,
                  std::size_t l) {
  const bool given = l < single.size() && single[l].size() == layers[l].weight.size();
  return {layers[l].weight, given ? single[l].data() : nullptr};
}

/// sum += a b.
void Add(const Weights& a, const Eigen::Ref<const Eigen::MatrixXd>& b,
         Eigen::Ref<Eigen::MatrixXd> sum) {
  AddProduct<double>({a.full.rows(), b.cols(), a.full.cols(), a.full.data(), a.full.rows(),
                      b.data(), b.outerStride(), sum.data(), sum.outerStride(), a.single});
}

Eigen::MatrixXd Product(const Weights& a, const Eigen::Ref<const Eigen::MatrixXd>& b) {
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(a.full.rows(), b.cols());
  Add(a, b, product);
  return product;
}

/// a times `count` columns of b.
Eigen::MatrixXd Product(const Eigen::MatrixXd& a, const Weights& b, Eigen::Index first,
                        Eigen::Index count) {
  Eigen::MatrixXd product = Eigen::MatrixXd::Zero(a.rows(), count);
  const Eigen::Index skipped = first * b.full.rows();
  AddProduct<double>({a.rows(), count, a.cols(), a.data(), a.rows(), b.full.data() + skipped,
                      b.full.rows(), product.data(), product.rows(), nullptr,
                      b.single != nullptr ? b.single + skipped : nullptr});
  return product;
}

/// Leaky ReLU in place; its slopes at the given values.
Eigen::VectorXd Activate(Eigen::VectorXd& values) {
  const Eigen::VectorXd slopes =
      (values.array() < 0).select(Eigen::VectorXd::Constant(values.size(), kNetworkSlope), 1.0);
  values.array() *= slopes.array();
  return slopes;
}

}  // namespace

Eigen::Index NumNetworkInputs(Eigen::Index num_joints, Eigen::Index num_vertices,
                              NetworkKind kind) {
  Eigen::Index inputs = 4 * num_joints;
  if (kind != NetworkKind::kPose) inputs += kNetworkBetas;
  if (kind == NetworkKind::kPoseShapeContact) inputs += num_vertices;
  return inputs;
}

std::optional<NetworkKind> KindOfNetwork(const FootModel& model) {
  if (model.network.empty()) return {};
  const Eigen::Index inputs = model.network.front().weight.cols();
  for (const NetworkKind kind :
       {NetworkKind::kPose, NetworkKind::kPoseShape, NetworkKind::kPoseShapeContact}) {
    if (NumNetworkInputs(model.NumJoints(), model.NumVertices(), kind) == inputs) return kind;
  }
  throw Error(fmt::format(
      "foot model: its network takes {} inputs, expected {} (pose), {} (and shape) or {} (and "
      "contact); the file is damaged or of another model",
      inputs, NumNetworkInputs(model.NumJoints(), model.NumVertices(), NetworkKind::kPose),
      NumNetworkInputs(model.NumJoints(), model.NumVertices(), NetworkKind::kPoseShape),
      NumNetworkInputs(model.NumJoints(), model.NumVertices())));
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

Eigen::VectorXd EvaluateNetwork(std::span<const NetworkLayer> layers, const Eigen::VectorXd& input,
                                std::span<const Eigen::MatrixXf> single) {
  Eigen::VectorXd value = input.head(layers.front().weight.cols());
  for (std::size_t l = 0; l < layers.size(); ++l) {
    Eigen::VectorXd next = layers[l].bias;
    Add(WeightsOf(layers, single, l), value, next);
    if (l + 1 < layers.size()) next = next.cwiseMax(kNetworkSlope * next);
    value.swap(next);
  }
  return value;
}

NetworkFactors DifferentiateNetwork(std::span<const NetworkLayer> layers,
                                    const Eigen::VectorXd& input, Eigen::Index first_input,
                                    Eigen::Index num_inputs,
                                    std::span<const Eigen::MatrixXf> single) {
  const std::size_t last = layers.size() - 1;
  const auto weights = [&](std::size_t l) { return WeightsOf(layers, single, l); };
  std::vector<Eigen::VectorXd> slopes;
  Eigen::VectorXd value = input.head(layers.front().weight.cols());
  std::size_t narrowest = 0;
  for (std::size_t l = 0; l <= last; ++l) {
    Eigen::VectorXd next = layers[l].bias;
    Add(weights(l), value, next);
    if (l < last) slopes.push_back(Activate(next));
    value.swap(next);
    if (l < last && value.size() < layers[narrowest].bias.size()) narrowest = l;
  }
  NetworkFactors factors;
  factors.value = std::move(value);
  if (last == 0) {
    factors.outer = layers[0].weight.middleCols(first_input, num_inputs);
    factors.inner = Eigen::MatrixXd::Identity(num_inputs, num_inputs);
    return factors;
  }
  factors.outer = layers[narrowest + 1].weight;
  for (std::size_t l = narrowest + 2; l <= last; ++l)
    factors.outer = Product(weights(l), slopes[l - 1].asDiagonal() * factors.outer);
  factors.inner = slopes[narrowest].asDiagonal() * layers[narrowest].weight;
  for (std::size_t l = narrowest; l-- > 0;) {
    const Eigen::MatrixXd scaled = factors.inner * slopes[l].asDiagonal();
    factors.inner = l > 0 ? Product(scaled, weights(l), 0, layers[l].weight.cols())
                          : Product(scaled, weights(0), first_input, num_inputs);
  }
  if (narrowest == 0) factors.inner = factors.inner.middleCols(first_input, num_inputs).eval();
  return factors;
}

Eigen::VectorXd ContactOffsets(const FootModel& model, Variant variant,
                               const Eigen::MatrixX3d& theta, const Eigen::VectorXd& beta,
                               const Eigen::VectorXd& contact) {
  if (model.network.empty()) return {};
  const Eigen::VectorXd input = NetworkInput(theta, beta, contact, model.NumVertices());
  return Upsample(model, variant, EvaluateNetwork(model.network, input, model.derived.network_single));
}

NetworkFactors ContactOffsetsByPose(const FootModel& model, Variant variant,
                                    const Eigen::MatrixX3d& theta, const Eigen::VectorXd& beta,
                                    const Eigen::VectorXd& contact) {
  if (model.network.empty()) return {};
  const Eigen::Index joints = theta.rows(), betas = std::min(kNetworkBetas, beta.size());
  const Eigen::VectorXd input = NetworkInput(theta, beta, contact, model.NumVertices());
  const Eigen::Index given =
      std::min(model.network.front().weight.cols(), 4 * joints + kNetworkBetas);
  NetworkFactors factors =
      DifferentiateNetwork(model.network, input, 0, given, model.derived.network_single);
  Eigen::MatrixXd inner(factors.inner.rows(), 3 * joints + betas);
  for (Eigen::Index j = 0; j < joints; ++j) {
    inner.middleCols<3>(3 * j).noalias() =
        factors.inner.middleCols<4>(4 * j) * QuaternionFeatureJacobian(theta.row(j));
  }
  if (given > 4 * joints) {
    inner.rightCols(betas) = factors.inner.middleCols(4 * joints, betas);
  } else {
    inner.rightCols(betas).setZero();
  }
  factors.inner = std::move(inner);
  return Upsample(model, variant, std::move(factors));
}

NetworkFactors ContactOffsetsByContact(const FootModel& model, Variant variant,
                                       const Eigen::MatrixX3d& theta, const Eigen::VectorXd& beta,
                                       const Eigen::VectorXd& contact) {
  if (model.network.empty()) return {};
  const Eigen::VectorXd input = NetworkInput(theta, beta, contact, model.NumVertices());
  const Eigen::Index first = 4 * theta.rows() + kNetworkBetas, contacts = model.NumVertices();
  if (model.network.front().weight.cols() <= first) {
    NetworkFactors none;
    none.value = ContactOffsets(model, variant, theta, beta, contact);
    none.outer = Eigen::MatrixXd::Zero(none.value.size(), 1);
    none.inner = Eigen::MatrixXd::Zero(1, contacts);
    return none;
  }
  NetworkFactors factors = DifferentiateNetwork(model.network, input, first, contacts,
                                                model.derived.network_single);
  return Upsample(model, variant, std::move(factors));
}

}  // namespace sole::model
