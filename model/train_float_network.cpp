#include "model/train_float_network.h"

#include <cstddef>
#include <utility>

#include "core/error.h"
#include "model/contact_network.h"

namespace sole::model {
namespace {

constexpr float kSlope = static_cast<float>(kNetworkSlope);

using ConstWeight = Eigen::Map<const Eigen::MatrixXf>;
using ConstBias = Eigen::Map<const Eigen::VectorXf>;

/// Where a layer's parameters begin.
std::vector<Eigen::Index> Starts(std::span<const Eigen::Index> widths) {
  std::vector<Eigen::Index> starts = {0};
  for (std::size_t l = 0; l + 1 < widths.size(); ++l)
    starts.push_back(starts.back() + widths[l + 1] * (widths[l] + 1));
  return starts;
}

}  // namespace

Eigen::Index NumParameters(std::span<const Eigen::Index> widths) { return Starts(widths).back(); }

ForwardPass RunForward(const FloatNetwork& network, const Eigen::MatrixXf& inputs) {
  const std::vector<Eigen::Index>& widths = network.widths;
  const std::vector<Eigen::Index> starts = Starts(widths);
  Require(widths.size() >= 2 && inputs.rows() == widths[0] &&
              network.parameters.size() == starts.back(),
          "network: inputs or parameters do not fit its layers");
  ForwardPass pass;
  pass.into.push_back(inputs);
  for (std::size_t l = 0; l + 1 < widths.size(); ++l) {
    const float* at = network.parameters.data() + starts[l];
    const ConstWeight weight(at, widths[l + 1], widths[l]);
    const ConstBias bias(at + weight.size(), widths[l + 1]);
    Eigen::MatrixXf next = weight * pass.into[l];
    next.colwise() += bias;
    if (l + 2 == widths.size()) {
      pass.values = std::move(next);
    } else {
      pass.into.push_back(next.cwiseMax(kSlope * next));
    }
  }
  return pass;
}

Eigen::MatrixXf EvaluateBatch(const FloatNetwork& network, const Eigen::MatrixXf& inputs) {
  return RunForward(network, inputs).values;
}

Eigen::VectorXf RunBackward(const FloatNetwork& network, const ForwardPass& pass,
                            Eigen::MatrixXf by_values) {
  const std::vector<Eigen::Index>& widths = network.widths;
  const std::vector<Eigen::Index> starts = Starts(widths);
  Require(by_values.rows() == widths.back() && by_values.cols() == pass.values.cols(),
          "network: the derivative does not fit the values");
  Eigen::VectorXf gradient(starts.back());
  Eigen::MatrixXf by_output = std::move(by_values);
  for (std::size_t l = widths.size() - 1; l-- > 0;) {
    const Eigen::Index outputs = widths[l + 1], inputs = widths[l];
    float* at = gradient.data() + starts[l];
    Eigen::Map<Eigen::MatrixXf>(at, outputs, inputs).noalias() =
        by_output * pass.into[l].transpose();
    Eigen::Map<Eigen::VectorXf>(at + outputs * inputs, outputs) = by_output.rowwise().sum();
    if (l == 0) break;
    const ConstWeight weight(network.parameters.data() + starts[l], outputs, inputs);
    Eigen::MatrixXf by_input = weight.transpose() * by_output;
    // A leaky ReLU keeps the sign, so its slope can be read from its value.
    by_input = (pass.into[l].array() < 0).select(kSlope * by_input, by_input);
    by_output = std::move(by_input);
  }
  return gradient;
}

std::vector<NetworkLayer> LayersOf(const FloatNetwork& network) {
  const std::vector<Eigen::Index> starts = Starts(network.widths);
  std::vector<NetworkLayer> layers;
  for (std::size_t l = 0; l + 1 < network.widths.size(); ++l) {
    const float* at = network.parameters.data() + starts[l];
    const ConstWeight weight(at, network.widths[l + 1], network.widths[l]);
    const ConstBias bias(at + weight.size(), network.widths[l + 1]);
    layers.push_back({weight.cast<double>(), bias.cast<double>()});
  }
  return layers;
}

}  // namespace sole::model
