#pragma once

#include <Eigen/Core>
#include <vector>

namespace sole::model {

/// Weights w >= 0 with sum 1 and at most `max_entries` of them non-zero that make w' H w - 2 g' w
/// small (H symmetric, positive semidefinite): least squares |A w - b|^2 with H = A' A, g = A' b.
/// Entries that are not `allowed` stay zero (empty: all are allowed). Active-set method; the
/// support is the largest entries of the full solution.
Eigen::VectorXd FitOnSimplex(const Eigen::MatrixXd& h, const Eigen::VectorXd& g, int max_entries,
                             const std::vector<bool>& allowed = {});

}  // namespace sole::model
