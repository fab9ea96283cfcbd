#include "model/pose_prior.h"

#include <cmath>

#include <Eigen/Dense>

namespace sole::model {

Eigen::VectorXd PosePrior::Deviations(const Eigen::MatrixX3d& theta) const {
  Eigen::VectorXd values(mean.size());
  for (Eigen::Index j = 0; j < theta.rows(); ++j) values.segment<3>(3 * j) = theta.row(j);
  const Eigen::VectorXd unit = root * (values - mean);
  Eigen::VectorXd deviations(theta.rows());
  for (Eigen::Index j = 0; j < theta.rows(); ++j) deviations[j] = unit.segment<3>(3 * j).norm();
  return deviations;
}

PosePrior PosePriorOf(const FootModel& model, const PosePriorOptions& options) {
  const Eigen::Index all = 3 * model.NumJoints(), values = all - 3;
  PosePrior prior{Eigen::VectorXd::Zero(all), Eigen::MatrixXd::Zero(all, all)};
  const PoseSpace& space = model.pose_space;
  if (space.Empty()) {
    prior.root.diagonal().tail(values).setConstant(1 / options.free_rad);
    return prior;
  }
  prior.mean.tail(values) = space.mean;
  const Eigen::Index stored = space.components.cols(), left = std::max<Eigen::Index>(values - stored, 1);
  const double floor2 = options.floor_rad * options.floor_rad;
  const double rest = 1 / std::sqrt(space.variances.tail(values - stored).sum() / static_cast<double>(left) + floor2);
  // The symmetric root keeps values by their joints: along the components their own deviations, `rest` in every other direction.
  const Eigen::VectorXd along = (space.variances.head(stored).array().max(0) + floor2).rsqrt() - rest;
  prior.root.bottomRightCorner(values, values) =
      space.components * along.asDiagonal() * space.components.transpose();
  prior.root.diagonal().tail(values).array() += rest;
  return prior;
}

}  // namespace sole::model
