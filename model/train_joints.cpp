#include "model/train_joints.h"

#include <Eigen/Cholesky>
#include <cstddef>

#include "core/error.h"

namespace sole::model {

Eigen::MatrixXd SubtreeWeights(const Eigen::MatrixXd& weights, const std::vector<int>& parents) {
  Eigen::MatrixXd sums = weights;
  for (std::size_t j = parents.size(); j-- > 1;)  // children come after their parents
    sums.col(parents[j]) += sums.col(static_cast<Eigen::Index>(j));
  return sums;
}

Eigen::MatrixX3d FitJoints(const FootModel& personal, std::span<const JointEvidence> evidence,
                           const Eigen::MatrixX3d& prior_m, const JointFitOptions& options) {
  const Eigen::Index k = personal.NumJoints();
  Require(prior_m.rows() == k && options.sigma_m > 0 && options.prior_sd_m > 0,
          "joint centres: the prior does not fit the model");
  const Eigen::MatrixXd subtree = SubtreeWeights(personal.coarse.weights, personal.parents);
  const double information = 1 / (options.sigma_m * options.sigma_m),
               prior = 1 / (options.prior_sd_m * options.prior_sd_m);
  Eigen::MatrixXd normal = prior * Eigen::MatrixXd::Identity(3 * k, 3 * k);
  const Eigen::Matrix3Xd off = (prior_m - personal.derived.joints_m).transpose();
  Eigen::VectorXd right = prior * Eigen::Map<const Eigen::VectorXd>(off.data(), 3 * k);
  for (const JointEvidence& frame : evidence) {
    const double sum = frame.weights.sum();
    if (sum <= 0) continue;
    // A free translation takes the weighted means away.
    const Eigen::RowVectorXd mean = frame.weights.transpose() * subtree / sum;
    const Eigen::MatrixXd centred = subtree.rowwise() - mean;
    const Eigen::MatrixX3d residual = frame.targets_m - frame.vertices_m;
    const Eigen::MatrixXd weighted = frame.weights.asDiagonal() * centred;
    const Eigen::MatrixXd products = information * centred.transpose() * weighted;
    const Eigen::MatrixX3d pulls = information * weighted.transpose() * residual;
    std::vector<Eigen::Matrix3d> moves(static_cast<std::size_t>(k), Eigen::Matrix3d::Zero());
    for (std::size_t j = 1; j < moves.size(); ++j) {
      moves[j] = frame.rotations[static_cast<std::size_t>(personal.parents[j])] -
                 frame.rotations[j];
    }
    for (Eigen::Index a = 1; a < k; ++a) {
      const Eigen::Matrix3d turned = moves[static_cast<std::size_t>(a)].transpose();
      right.segment<3>(3 * a) += turned * pulls.row(a).transpose();
      for (Eigen::Index b = 1; b < k; ++b) {
        normal.block<3, 3>(3 * a, 3 * b) +=
            products(a, b) * turned * moves[static_cast<std::size_t>(b)];
      }
    }
  }
  const Eigen::VectorXd step = normal.ldlt().solve(right);
  return personal.derived.joints_m +
         Eigen::Map<const Eigen::Matrix3Xd>(step.data(), 3, k).transpose();
}

}  // namespace sole::model
