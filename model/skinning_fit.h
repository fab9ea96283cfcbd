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
  double prior_weight_m = 0.0005;  ///< a weight that differs by 1 from the prior costs as much as
                                   ///< this error in every sample
};

/// Skinning weights (N x K, rows sum to 1, non-negative) that reproduce the samples best with
/// linear blend skinning. Only joints with a positive `prior` (N x K, rows sum to 1) may move a
/// vertex.
Eigen::MatrixXd FitSkinningWeights(std::span<const PosedSample> samples,
                                   const Eigen::MatrixXd& prior,
                                   const SkinningFitOptions& options = {});

}  // namespace sole::model
