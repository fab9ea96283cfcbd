#pragma once

#include <Eigen/Core>

#include "model/foot_model.h"

namespace sole::model {

struct PosePriorOptions {
  double floor_rad = 0.05;  ///< added to every direction's deviation: people whom training has not seen bend otherwise
  double free_rad = 0.3;    ///< every joint but the root, in a model that does not say how poses are distributed
};

/// Gaussian of theta (3K values, joint by joint); the root is free.
struct PosePrior {
  Eigen::VectorXd mean;  ///< 3K, rad
  Eigen::MatrixXd root;  ///< 3K x 3K, root * (theta - mean) has unit deviations; rows of the root joint are zero

  /// Of every joint (K): how many deviations its row of a pose (K x 3) is off, once what it shares with others is taken out.
  Eigen::VectorXd Deviations(const Eigen::MatrixX3d& theta) const;
};

/// From the model's pose space (all components, those not stored share what variance is left): toes bend together, mostly up and
/// down, so one that the scan does not show follows the others. Without a pose space every joint is held to its rest.
PosePrior PosePriorOf(const FootModel& model, const PosePriorOptions& options = {});

}  // namespace sole::model
