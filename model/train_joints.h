#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "model/foot_model.h"

namespace sole::model {

/// One posed registration seen with joints at their present places.
struct JointEvidence {
  Eigen::MatrixX3d targets_m;              ///< N x 3
  Eigen::MatrixX3d vertices_m;             ///< N x 3, the posed model
  std::vector<Eigen::Matrix3d> rotations;  ///< K, of the bones in the world
  Eigen::VectorXd weights;                 ///< N
};

struct JointFitOptions {
  double sigma_m = 0.003;  ///< what one vertex is worth
  double prior_sd_m = 0.003;
};

/// A person's joint centres, K x 3. With the bones' rotations given, a posed vertex is linear in the
/// centres: moving joint j by d moves vertex i by S_ij (R_parent - R_j) d, where S_ij is the sum of
/// i's weights on j and what hangs on it. Least squares over all registrations and a prior around
/// `prior_m`; translations are free, the root stays where the prior has it.
Eigen::MatrixX3d FitJoints(const FootModel& personal, std::span<const JointEvidence> evidence,
                           const Eigen::MatrixX3d& prior_m, const JointFitOptions& options = {});

/// N x K: sum of each vertex's weights on a joint and on what hangs on it.
Eigen::MatrixXd SubtreeWeights(const Eigen::MatrixXd& weights, const std::vector<int>& parents);

}  // namespace sole::model
