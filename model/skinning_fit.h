#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "core/rigid3.h"

namespace sole::model {

/// One pose of one person for learning weights: the skin at rest, posed, and the true motion of
/// each joint's bone.
struct PosedSample {
  Eigen::MatrixX3d rest_m;              ///< N x 3
  Eigen::MatrixX3d posed_m;             ///< N x 3
  std::vector<Rigid3> posed_from_rest;  ///< K
};

struct SkinningFitOptions {
  int max_influences = 4;
  /// A weight that differs by 1 from the prior costs as much as this error in every sample.
  double prior_weight_m = 0.0005;
  double prior_samples = 0;  ///< this many more that only the prior counts in
};

/// What samples say about the weights, summed sample by sample: its size does not grow with them.
struct SkinningEvidence {
  std::vector<Eigen::MatrixXd> products;  ///< per vertex, K x K
  Eigen::VectorXd count;                  ///< per vertex, the sum of the samples' weights
};
SkinningEvidence NoSkinningEvidence(Eigen::Index num_vertices, Eigen::Index num_joints);

/// Adds a sample; `counts`: how much it says about each vertex (empty: 1).
void AddEvidence(const PosedSample& sample, const Eigen::VectorXd& counts,
                 SkinningEvidence& evidence);

/// As FitSkinningWeights, from what was summed. A vertex of which little was seen keeps its prior.
Eigen::MatrixXd SolveSkinningWeights(const SkinningEvidence& evidence, const Eigen::MatrixXd& prior,
                                     const SkinningFitOptions& options = {});

/// Skinning weights (N x K, rows sum to 1, non-negative) that reproduce the samples best with
/// linear blend skinning. Only joints with a positive `prior` (N x K, rows sum to 1) may move a
/// vertex.
Eigen::MatrixXd FitSkinningWeights(std::span<const PosedSample> samples,
                                   const Eigen::MatrixXd& prior,
                                   const SkinningFitOptions& options = {});

/// A prior that lets every joint's parent and children move a vertex too, with a small share. Rows
/// sum to 1.
Eigen::MatrixXd WidenedWeights(const Eigen::MatrixXd& weights, const std::vector<int>& parents);

}  // namespace sole::model
