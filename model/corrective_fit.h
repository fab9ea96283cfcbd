#pragma once

#include <Eigen/Core>
#include <span>

namespace sole::model {

/// Pose correctives by ridge regression. `offsets`: per sample the stacked rest-pose offsets (3N)
/// that the linear model lacks; `features`: per sample the pose features (P). `allowed` (N x P):
/// features a vertex may use. Minimises sum |offset - posedirs * feature|^2 + samples * ridge *
/// |posedirs|^2 per vertex. Returns 3N x P.
Eigen::MatrixXd FitCorrectives(std::span<const Eigen::VectorXd> offsets,
                               std::span<const Eigen::VectorXd> features,
                               const Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic>& allowed,
                               double ridge);

}  // namespace sole::model
