#include "model/skinning_fit.h"

#include <tbb/parallel_for.h>

#include <cstddef>

#include "core/error.h"
#include "model/simplex_fit.h"

namespace sole::model {

SkinningEvidence NoSkinningEvidence(Eigen::Index num_vertices, Eigen::Index num_joints) {
  return {std::vector<Eigen::MatrixXd>(static_cast<std::size_t>(num_vertices),
                                       Eigen::MatrixXd::Zero(num_joints, num_joints)),
          Eigen::VectorXd::Zero(num_vertices)};
}

void AddEvidence(const PosedSample& sample, const Eigen::VectorXd& counts,
                 SkinningEvidence& evidence) {
  const Eigen::Index n = evidence.count.size(),
                     k = static_cast<Eigen::Index>(sample.posed_from_rest.size());
  Require(sample.rest_m.rows() == n && sample.posed_m.rows() == n &&
              (counts.size() == 0 || counts.size() == n) &&
              (n == 0 || evidence.products[0].rows() == k),
          "skinning weights: a sample's size does not fit the prior");
  tbb::parallel_for(Eigen::Index{0}, n, [&](Eigen::Index i) {
    const double count = counts.size() > 0 ? counts[i] : 1;
    if (count <= 0) return;
    const Eigen::Vector3d rest = sample.rest_m.row(i), posed = sample.posed_m.row(i);
    // Relative to the target, so that large coordinates do not hide small differences: |sum w
    // (x_k - y)|^2.
    Eigen::Matrix3Xd moved(3, k);
    for (Eigen::Index j = 0; j < k; ++j)
      moved.col(j) = sample.posed_from_rest[static_cast<std::size_t>(j)] * rest - posed;
    evidence.products[static_cast<std::size_t>(i)] += count * moved.transpose() * moved;
    evidence.count[i] += count;
  });
}

Eigen::MatrixXd SolveSkinningWeights(const SkinningEvidence& evidence, const Eigen::MatrixXd& prior,
                                     const SkinningFitOptions& options) {
  const Eigen::Index n = prior.rows(), k = prior.cols();
  Require(evidence.count.size() == n, "skinning weights: the prior is of other vertices");
  Eigen::MatrixXd weights(n, k);
  tbb::parallel_for(Eigen::Index{0}, n, [&](Eigen::Index i) {
    const double ridge = options.prior_weight_m * options.prior_weight_m *
                         (evidence.count[i] + options.prior_samples);
    Eigen::MatrixXd h = evidence.products[static_cast<std::size_t>(i)];
    h.diagonal().array() += ridge;
    const Eigen::VectorXd g = ridge * prior.row(i).transpose();
    std::vector<bool> allowed(static_cast<std::size_t>(k));
    for (Eigen::Index j = 0; j < k; ++j) allowed[static_cast<std::size_t>(j)] = prior(i, j) > 0;
    weights.row(i) = FitOnSimplex(h, g, options.max_influences, allowed);
  });
  return weights;
}

Eigen::MatrixXd FitSkinningWeights(std::span<const PosedSample> samples,
                                   const Eigen::MatrixXd& prior,
                                   const SkinningFitOptions& options) {
  SkinningEvidence evidence = NoSkinningEvidence(prior.rows(), prior.cols());
  for (const PosedSample& sample : samples) AddEvidence(sample, {}, evidence);
  return SolveSkinningWeights(evidence, prior, options);
}

Eigen::MatrixXd WidenedWeights(const Eigen::MatrixXd& weights, const std::vector<int>& parents) {
  Eigen::MatrixXd widened = weights;
  for (std::size_t j = 1; j < parents.size(); ++j) {
    widened.col(static_cast<Eigen::Index>(j)) += 0.02 * weights.col(parents[j]);
    widened.col(parents[j]) += 0.02 * weights.col(static_cast<Eigen::Index>(j));
  }
  for (Eigen::Index i = 0; i < widened.rows(); ++i) {
    widened.row(i) = (widened.row(i).array() < 0.002).select(0, widened.row(i)).eval();
    widened.row(i) /= widened.row(i).sum();
  }
  return widened;
}

}  // namespace sole::model
