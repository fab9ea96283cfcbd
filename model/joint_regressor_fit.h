#pragma once

#include <Eigen/Core>
#include <span>

namespace sole::model {

struct JointRegressorOptions {
  int candidates = 40;      ///< nearest vertices a joint may use
  int max_vertices = 12;    ///< of them that it uses at most
  double spread_m = 0.002;  ///< error that counts as much as resting the whole weight on one vertex
};

/// Sparse joint regressor (K x N, rows non-negative with sum 1, so it follows any affine motion)
/// that maps the vertices of each sample to its joints. `vertices`: N x 3 each; `joints`: K x 3
/// each, same number.
Eigen::MatrixXd FitJointRegressor(std::span<const Eigen::MatrixX3d> vertices,
                                  std::span<const Eigen::MatrixX3d> joints,
                                  const JointRegressorOptions& options = {});

}  // namespace sole::model
