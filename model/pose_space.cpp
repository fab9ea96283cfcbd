#include "model/pose_space.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

#include "core/error.h"

namespace sole::model {
namespace {

/// A Gaussian ready to be evaluated.
struct Gaussian {
  Eigen::VectorXd mean;
  Eigen::LLT<Eigen::MatrixXd> factor;
  double log_weight = 0;  ///< log(weight) less half the log determinant of 2 pi covariance

  double LogDensity(const Eigen::VectorXd& at) const {
    return log_weight - 0.5 * factor.matrixL().solve(at - mean).squaredNorm();
  }
};

Gaussian GaussianOf(const PoseSpace& space, Eigen::Index g) {
  const Eigen::Index c = space.means.cols();
  Gaussian gaussian;
  gaussian.mean = space.means.row(g);
  const Eigen::VectorXd entries = space.covariances.row(g);
  gaussian.factor.compute(Eigen::Map<const Eigen::MatrixXd>(entries.data(), c, c));
  Require(gaussian.factor.info() == Eigen::Success,
          "pose space: a covariance is not positive definite");
  double half_log = 0;
  for (Eigen::Index i = 0; i < c; ++i) half_log += std::log(gaussian.factor.matrixLLT()(i, i));
  gaussian.log_weight = std::log(space.weights[g]) - half_log -
                        0.5 * static_cast<double>(c) * std::log(2 * std::numbers::pi);
  return gaussian;
}

/// Shares of the Gaussians in each point (G x points); returns the mean log density.
double Responsibilities(const PoseSpace& space, const Eigen::MatrixXd& points,
                        Eigen::MatrixXd& shares) {
  std::vector<Gaussian> gaussians;
  for (Eigen::Index g = 0; g < space.weights.size(); ++g) gaussians.push_back(GaussianOf(space, g));
  shares.resize(space.weights.size(), points.cols());
  double sum = 0;
  for (Eigen::Index p = 0; p < points.cols(); ++p) {
    for (std::size_t g = 0; g < gaussians.size(); ++g)
      shares(static_cast<Eigen::Index>(g), p) = gaussians[g].LogDensity(points.col(p));
    const double largest = shares.col(p).maxCoeff();
    shares.col(p) = (shares.col(p).array() - largest).exp();
    const double total = shares.col(p).sum();
    shares.col(p) /= total;
    sum += largest + std::log(total);
  }
  return sum / static_cast<double>(points.cols());
}

void Maximise(const Eigen::MatrixXd& points, const Eigen::MatrixXd& shares, double floor_rad,
              PoseSpace& space) {
  const Eigen::Index count = points.cols();
  for (Eigen::Index g = 0; g < shares.rows(); ++g) {
    const double sum = std::max(shares.row(g).sum(), 1e-9);
    const Eigen::VectorXd mean = points * shares.row(g).transpose() / sum;
    const Eigen::MatrixXd centred = points.colwise() - mean;
    Eigen::MatrixXd covariance = centred * shares.row(g).asDiagonal() * centred.transpose() / sum;
    covariance.diagonal().array() += floor_rad * floor_rad;
    space.weights[g] = sum / static_cast<double>(count);
    space.means.row(g) = mean;
    space.covariances.row(g) = covariance.reshaped().transpose();
  }
  space.weights /= space.weights.sum();
}

/// Each point to the nearest of centres that lie far apart (k-means++).
Eigen::MatrixXd FirstShares(const Eigen::MatrixXd& points, Eigen::Index gaussians,
                            std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  const auto uniform = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  const Eigen::Index count = points.cols();
  Eigen::VectorXd nearest =
      Eigen::VectorXd::Constant(count, std::numeric_limits<double>::infinity());
  std::vector<Eigen::Index> owner(static_cast<std::size_t>(count), 0);
  auto centre = static_cast<Eigen::Index>(uniform() * static_cast<double>(count));
  for (Eigen::Index g = 0; g < gaussians; ++g) {
    for (Eigen::Index p = 0; p < count; ++p) {
      const double distance = (points.col(p) - points.col(centre)).squaredNorm();
      if (distance >= nearest[p]) continue;
      nearest[p] = distance;
      owner[static_cast<std::size_t>(p)] = g;
    }
    double left = uniform() * nearest.sum();
    centre = 0;
    while (centre + 1 < count && left > nearest[centre]) left -= nearest[centre++];
  }
  Eigen::MatrixXd shares = Eigen::MatrixXd::Zero(gaussians, count);
  for (Eigen::Index p = 0; p < count; ++p) shares(owner[static_cast<std::size_t>(p)], p) = 1;
  return shares;
}

}  // namespace

Eigen::VectorXd PoseValues(const Eigen::MatrixX3d& theta) {
  const Eigen::Matrix3Xd joints = theta.bottomRows(theta.rows() - 1).transpose();
  return Eigen::Map<const Eigen::VectorXd>(joints.data(), joints.size());
}

PoseSpace LearnPoseSpace(const Eigen::MatrixXd& poses, const PoseSpaceOptions& options) {
  const Eigen::Index count = poses.rows(), values = poses.cols();
  Require(count >= 2 && values >= 1, "pose space: it needs two or more poses");
  Require(options.components >= 1 && options.gaussians >= 1 && options.floor_rad > 0,
          "pose space: an option is out of its range");
  PoseSpace space;
  space.mean = poses.colwise().mean();
  const Eigen::MatrixXd centred = poses.rowwise() - space.mean.transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(
      centred.transpose() * centred / static_cast<double>(count - 1));
  space.variances = solver.eigenvalues().reverse().cwiseMax(0);
  const Eigen::Index c = std::min({options.components, values, count - 1});
  space.components = solver.eigenvectors().rowwise().reverse().leftCols(c);
  for (Eigen::Index i = 0; i < c; ++i) {  // a sign that does not hang on the solver
    Eigen::Index largest = 0;
    space.components.col(i).cwiseAbs().maxCoeff(&largest);
    if (space.components(largest, i) < 0) space.components.col(i) *= -1;
  }
  const Eigen::MatrixXd points = (centred * space.components).transpose();
  const Eigen::Index gaussians = std::clamp<Eigen::Index>(count / (10 * c), 1, options.gaussians);
  space.weights = Eigen::VectorXd::Ones(gaussians);
  space.means.resize(gaussians, c);
  space.covariances.resize(gaussians, c * c);
  Eigen::MatrixXd shares = FirstShares(points, gaussians, options.seed);
  double before = -std::numeric_limits<double>::infinity();
  for (int i = 0; i < options.iterations; ++i) {
    Maximise(points, shares, options.floor_rad, space);
    const double now = Responsibilities(space, points, shares);
    if (now - before < 1e-5) break;
    before = now;
  }
  return space;
}

PoseEnergy EnergyOf(const PoseSpace& space, const Eigen::VectorXd& pose_values) {
  Require(!space.Empty() && pose_values.size() == space.mean.size(),
          "pose space: a pose of another model");
  const Eigen::VectorXd at = space.components.transpose() * (pose_values - space.mean);
  PoseEnergy energy{std::numeric_limits<double>::infinity(), {}};
  for (Eigen::Index g = 0; g < space.weights.size(); ++g) {
    const Gaussian gaussian = GaussianOf(space, g);
    const double value = -gaussian.LogDensity(at);
    if (value >= energy.value) continue;
    energy.value = value;
    energy.gradient = space.components * gaussian.factor.solve(at - gaussian.mean);
  }
  return energy;
}

}  // namespace sole::model
