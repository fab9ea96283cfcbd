#pragma once

#include <algorithm>
#include <cmath>
#include <functional>

#include <Eigen/Core>
#include <gtest/gtest.h>

namespace sole::testing_support {

/// Compares an analytic Jacobian with central differences of `f` at `x` (step 1e-6, error O(step^2)).
/// The shared checker: every Jacobian of the project passes it. `tolerance` is relative to the largest
/// entry of the Jacobian (at least 1).
inline void ExpectJacobianNear(const std::function<Eigen::VectorXd(const Eigen::VectorXd&)>& f,
                               const Eigen::VectorXd& x, const Eigen::MatrixXd& jacobian,
                               double tolerance = 1e-6, double step = 1e-6) {
  const Eigen::VectorXd value = f(x);
  ASSERT_EQ(jacobian.rows(), value.size());
  ASSERT_EQ(jacobian.cols(), x.size());
  const double scale = std::max(1.0, jacobian.cwiseAbs().maxCoeff());
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    Eigen::VectorXd plus = x, minus = x;
    plus[j] += step;
    minus[j] -= step;
    const Eigen::VectorXd numeric = (f(plus) - f(minus)) / (2 * step);
    for (Eigen::Index i = 0; i < value.size(); ++i) {
      EXPECT_NEAR(jacobian(i, j), numeric[i], tolerance * scale) << "row " << i << ", column " << j;
    }
  }
}

}  // namespace sole::testing_support
