#include "model/network_gradient.h"

#include <fmt/format.h>

#include <cstddef>
#include <utility>

#include "core/error.h"
#include "model/contact_network.h"

namespace sole::model {

NetworkGradient BackPropagate(std::span<const NetworkLayer> layers, const Eigen::MatrixXd& inputs,
                              const Eigen::MatrixXd& by_values) {
  Require(!layers.empty(), "network gradient: the network has no layers");
  Require(inputs.rows() == layers.front().weight.cols() &&
              by_values.rows() == layers.back().weight.rows() && inputs.cols() == by_values.cols(),
          fmt::format("network gradient: {} x {} inputs and {} x {} derivatives for a network of {} "
                      "inputs and {} values",
                      inputs.rows(), inputs.cols(), by_values.rows(), by_values.cols(),
                      layers.front().weight.cols(), layers.back().weight.rows()));
  // What goes into each layer; a leaky ReLU keeps the sign, so its slope can be read from its value.
  std::vector<Eigen::MatrixXd> into = {inputs};
  for (std::size_t l = 0; l + 1 < layers.size(); ++l) {
    Eigen::MatrixXd next = (layers[l].weight * into[l]).colwise() + layers[l].bias;
    into.push_back(next.cwiseMax(kNetworkSlope * next));
  }
  NetworkGradient gradient;
  gradient.layers.resize(layers.size());
  Eigen::MatrixXd by_output = by_values;
  for (std::size_t l = layers.size(); l-- > 0;) {
    gradient.layers[l] = {by_output * into[l].transpose(), by_output.rowwise().sum()};
    Eigen::MatrixXd by_input = layers[l].weight.transpose() * by_output;
    if (l > 0) by_input = (into[l].array() < 0).select(kNetworkSlope * by_input, by_input);
    by_output = std::move(by_input);
  }
  gradient.inputs = std::move(by_output);
  return gradient;
}

}  // namespace sole::model
