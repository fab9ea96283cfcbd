#include "recon/subset.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "recon/subset_kernel_internal.h"

namespace sole::recon {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double kHopelessZncc = 0.1;  // so far below what is asked for windows do not recover

/// W(p) after W(dp)^-1, both as (u, u_x, u_y, v, v_x, v_y).
SubsetWarp Compose(const SubsetWarp& warp, const Vector6& step) {
  Eigen::Matrix2d a;
  a << 1 + step[1], step[2], step[4], 1 + step[5];
  const Eigen::Matrix2d inverse = a.inverse();
  SubsetWarp result = warp;
  result.gradient = warp.gradient * inverse;
  result.position_px = warp.position_px - result.gradient * Eigen::Vector2d(step[0], step[3]);
  return result;
}

WarpPolynomial Polynomial(const SubsetWarp& w) {
  WarpPolynomial result;
  for (int axis = 0; axis < 2; ++axis) {
    result[static_cast<std::size_t>(axis)] = {w.position_px[axis],  w.gradient(axis, 0),
                                              w.gradient(axis, 1),  0.5 * w.curvature(axis, 0),
                                              w.curvature(axis, 1), 0.5 * w.curvature(axis, 2)};
  }
  return result;
}

}  // namespace

SubsetMatch MatchSubset(const PreparedImage& left, const PreparedImage& right, const ImageU8* mask,
                        const Eigen::Vector2i& centre, const SubsetWarp& start,
                        const SubsetOptions& options) {
  Require(options.radius_px >= 2 && options.radius_px <= kMaxRadius,
          "subset radius_px must be 2 to 15");
  SubsetMatch match;
  match.warp = start;
  const int r = options.radius_px;
  if (!WindowInside(left.coefficients, centre.x(), centre.y(), r)) return match;
  SubsetWindow window;
  FillWindow(left.coefficients, mask, centre.x(), centre.y(), r, window);
  const auto pixels = static_cast<double>(window.count);
  match.status = SubsetStatus::kFlat;
  if (pixels < options.min_window * window.Rows() * window.Rows() ||
      static_cast<double>(window.norm) < options.min_contrast * std::sqrt(pixels)) {
    return match;
  }
  const std::array<double, 36> normal = NormalMatrix(window);
  const Eigen::LDLT<Matrix6> solver(Eigen::Map<const Matrix6>(normal.data()));
  const auto pivots = solver.vectorD();
  if (solver.info() != Eigen::Success || !(pivots.minCoeff() > 1e-9 * pivots.maxCoeff()))
    return match;

  SubsetComparison comparison;
  bool converged = false;
  for (match.iterations = 1; match.iterations <= options.max_iterations; ++match.iterations) {
    comparison = Compare(window, right.coefficients, Polynomial(match.warp));
    if (!comparison.inside) {
      match.status = SubsetStatus::kOutside;
      return match;
    }
    match.zncc = comparison.zncc;
    const Vector6 step = -solver.solve(Eigen::Map<const Vector6>(comparison.gradient.data()));
    match.warp = Compose(match.warp, step);
    match.status = SubsetStatus::kDiverged;
    if (!step.allFinite() ||
        (match.warp.position_px - start.position_px).norm() > options.max_travel_px) {
      return match;
    }
    const double moved = std::max(std::abs(step[0]) + r * (std::abs(step[1]) + std::abs(step[2])),
                                  std::abs(step[3]) + r * (std::abs(step[4]) + std::abs(step[5])));
    // A last step this small changes correlation and residual by nothing that counts.
    converged = moved < options.convergence_px;
    if (converged) break;
    if (match.iterations >= options.patience && match.zncc < options.min_zncc - kHopelessZncc)
      return match;
  }
  if (!converged) return match;
  match.status = SubsetStatus::kPoor;
  if (match.zncc < options.min_zncc) return match;

  // A step acts on the left offset: it moves the match by gradient * step.
  const Matrix6 inverse = solver.solve(Matrix6::Identity());
  Eigen::Matrix2d step_covariance;
  step_covariance << inverse(0, 0), inverse(0, 3), inverse(3, 0), inverse(3, 3);
  constexpr double kLeastVariance = 0.1;  // rounding to whole grey levels in both images
  const double variance =
      std::max(kLeastVariance, comparison.squared_residual / std::max(1.0, pixels - 8));
  match.covariance_px2 =
      variance * (match.warp.gradient * step_covariance * match.warp.gradient.transpose());
  const double trace = match.covariance_px2.trace();
  match.status = trace <= options.max_sigma_px * options.max_sigma_px ? SubsetStatus::kMatched
                                                                      : SubsetStatus::kUncertain;
  return match;
}

}  // namespace sole::recon
