#pragma once

#include <ceres/problem.h>

#include <Eigen/Core>
#include <vector>

namespace sole::calib {

/// Covariance of the blocks `wanted` (in that order, in full parameter size) after marginalising
/// `others`: the corresponding block of (J^T J)^-1 at the problem's current values, for residuals
/// of unit variance. Rows and columns of values held constant are zero. Blocks of both lists must
/// cover the problem. Throws Error if the data do not determine the parameters.
Eigen::MatrixXd MarginalCovariance(ceres::Problem& problem, const std::vector<double*>& wanted,
                                   const std::vector<double*>& others);

}  // namespace sole::calib
