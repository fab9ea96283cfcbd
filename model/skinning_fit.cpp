#include "model/skinning_fit.h"

#include <cstddef>

#include "core/error.h"
#include "model/simplex_fit.h"

namespace sole::model {

Eigen::MatrixXd FitSkinningWeights(std::span<const PosedSample> samples,
                                   const Eigen::MatrixXd& prior,
                                   const SkinningFitOptions& options) {
  const Eigen::Index n = prior.rows(), k = prior.cols();
  for (const PosedSample& sample : samples) {
    Require(sample.rest_m.rows() == n && sample.posed_m.rows() == n &&
                static_cast<Eigen::Index>(sample.posed_from_rest.size()) == k,
            "skinning weights: a sample's size does not fit the prior");
  }
  Eigen::MatrixXd weights(n, k);
  const double ridge =
      options.prior_weight_m * options.prior_weight_m * static_cast<double>(samples.size());
  for (Eigen::Index i = 0; i < n; ++i) {
    Eigen::MatrixXd h = ridge * Eigen::MatrixXd::Identity(k, k);
    Eigen::VectorXd g = ridge * prior.row(i).transpose();
    Eigen::Matrix3Xd moved(3, k);
    for (const PosedSample& sample : samples) {
      const Eigen::Vector3d rest = sample.rest_m.row(i), posed = sample.posed_m.row(i);
      // Relative to the target, so that large coordinates do not hide small differences: |sum w
      // (x_k - y)|^2.
      for (Eigen::Index j = 0; j < k; ++j)
        moved.col(j) = sample.posed_from_rest[static_cast<std::size_t>(j)] * rest - posed;
      h += moved.transpose() * moved;
    }
    std::vector<bool> allowed(static_cast<std::size_t>(k));
    for (Eigen::Index j = 0; j < k; ++j) allowed[static_cast<std::size_t>(j)] = prior(i, j) > 0;
    weights.row(i) = FitOnSimplex(h, g, options.max_influences, allowed);
  }
  return weights;
}

}  // namespace sole::model
