#include "recon/subset.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/error.h"
#include "recon/subset_kernel_internal.h"

namespace sole::recon {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

constexpr double kHopelessZncc = 0.1;  // so far below what is asked for windows do not recover

constexpr float kPole = -0.26794919F;  // sqrt(3) - 2
constexpr int kHorizon = 14;           // kPole^14 < 1e-8

/// Cubic B-spline prefilter of one line of `n` values `step` apart, in place (mirrored ends; Unser
/// 1993).
void PrefilterRow(float* line, int n) {
  float sum = 0, power = 1;
  for (int i = 0; i < std::min(kHorizon, n); ++i, power *= kPole) sum += power * line[i];
  line[0] = 6 * sum;
  for (int i = 1; i < n; ++i) line[i] = 6 * line[i] + kPole * line[i - 1];
  line[n - 1] = kPole / (kPole * kPole - 1) * (line[n - 1] + kPole * line[n - 2]);
  for (int i = n - 2; i >= 0; --i) line[i] = kPole * (line[i + 1] - line[i]);
}

/// The same down the columns [x0, x1), row by row so that neighbours are handled together.
void PrefilterColumns(ImageF& image, int x0, int x1) {
  const int n = image.height;
  std::vector<float> sum(static_cast<std::size_t>(x1 - x0), 0.0F);
  float power = 1;
  for (int y = 0; y < std::min(kHorizon, n); ++y, power *= kPole) {
    const float* row = image.Row(y).data();
    for (int x = x0; x < x1; ++x) sum[static_cast<std::size_t>(x - x0)] += power * row[x];
  }
  float* first = image.Row(0).data();
  for (int x = x0; x < x1; ++x) first[x] = 6 * sum[static_cast<std::size_t>(x - x0)];
  for (int y = 1; y < n; ++y) {
    const float* above = image.Row(y - 1).data();
    float* row = image.Row(y).data();
    for (int x = x0; x < x1; ++x) row[x] = 6 * row[x] + kPole * above[x];
  }
  const float* before = image.Row(n - 2).data();
  float* last = image.Row(n - 1).data();
  for (int x = x0; x < x1; ++x)
    last[x] = kPole / (kPole * kPole - 1) * (last[x] + kPole * before[x]);
  for (int y = n - 2; y >= 0; --y) {
    const float* below = image.Row(y + 1).data();
    float* row = image.Row(y).data();
    for (int x = x0; x < x1; ++x) row[x] = kPole * (below[x] - row[x]);
  }
}

/// Gradients of the spline at the pixels.
void FillGradients(PreparedImage& image) {
  const ImageF& c = image.coefficients;
  image.gradient_x = ImageF(c.width, c.height);
  image.gradient_y = ImageF(c.width, c.height);
  tbb::parallel_for(1, c.height - 1, [&](int y) {
    const float *up = c.Row(y - 1).data(), *at = c.Row(y).data(), *down = c.Row(y + 1).data();
    float* gx = image.gradient_x.Row(y).data();
    float* gy = image.gradient_y.Row(y).data();
    constexpr float k = 1.0F / 12.0F;
    for (int x = 1; x < c.width - 1; ++x) {
      gx[x] =
          k * ((up[x + 1] - up[x - 1]) + 4 * (at[x + 1] - at[x - 1]) + (down[x + 1] - down[x - 1]));
      gy[x] = k * ((down[x - 1] - up[x - 1]) + 4 * (down[x] - up[x]) + (down[x + 1] - up[x + 1]));
    }
  });
}

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

PreparedImage Prepare(const ImageU8& image, bool with_gradients) {
  ImageF grey(image.width, image.height);
  std::copy(image.pixels.begin(), image.pixels.end(), grey.pixels.begin());
  return Prepare(std::move(grey), with_gradients);
}

PreparedImage Prepare(ImageF grey, bool with_gradients) {
  const int width = grey.width, height = grey.height;
  Require(width >= 16 && height >= 16, "image too small to match: at least 16 x 16 pixels");
  PreparedImage result;
  if (with_gradients) result.grey = grey;
  result.coefficients = std::move(grey);
  tbb::parallel_for(0, height,
                    [&](int y) { PrefilterRow(result.coefficients.Row(y).data(), width); });
  constexpr int kStrip = 128;
  tbb::parallel_for(0, (width + kStrip - 1) / kStrip, [&](int strip) {
    PrefilterColumns(result.coefficients, strip * kStrip,
                     std::min((strip + 1) * kStrip, width));
  });
  if (with_gradients) FillGradients(result);
  return result;
}

double GreyAt(const PreparedImage& image, const Eigen::Vector2d& position_px) {
  const ImageF& c = image.coefficients;
  if (!(position_px.x() >= 2 && position_px.y() >= 2 && position_px.x() <= c.width - 4 &&
        position_px.y() <= c.height - 4)) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  return static_cast<double>(SplineAt(c.pixels.data(), c.width, 0, 0,
                                      static_cast<float>(position_px.x()),
                                      static_cast<float>(position_px.y())));
}

SubsetMatch MatchSubset(const PreparedImage& left, const PreparedImage& right, const ImageU8* mask,
                        const Eigen::Vector2i& centre, const SubsetWarp& start,
                        const SubsetOptions& options) {
  Require(options.radius_px >= 2 && options.radius_px <= kMaxRadius,
          "subset radius_px must be 2 to 15");
  SubsetMatch match;
  match.warp = start;
  const int r = options.radius_px;
  if (centre.x() - r < 1 || centre.y() - r < 1 || centre.x() + r >= left.grey.width - 1 ||
      centre.y() + r >= left.grey.height - 1) {
    return match;
  }
  SubsetWindow window;
  FillWindow(left.grey, left.gradient_x, left.gradient_y, mask, centre.x(), centre.y(), r, window);
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
