#pragma once

#include <span>
#include <utility>
#include <vector>

#include <Eigen/Core>

namespace sole::model {

/// Symmetric positive definite system of 3 x 3 blocks over a mesh: one block for each vertex and one for each
/// edge (a, b), in row a and column b; its transpose stands in row b and column a.
struct BlockSystem {
  std::span<const std::pair<int, int>> edges;
  std::vector<Eigen::Matrix3d> diagonal;  ///< per vertex
  std::vector<Eigen::Matrix3d> coupling;  ///< per edge
  Eigen::Matrix3Xd right;                 ///< right-hand side, a column for each vertex
};

/// Solves by conjugate gradients from `start`, preconditioned by the diagonal blocks, until the residual
/// is `tolerance` times the right-hand side's size or `iterations` are spent.
Eigen::Matrix3Xd Solve(const BlockSystem& system, const Eigen::Matrix3Xd& start, double tolerance, int iterations);

}  // namespace sole::model
