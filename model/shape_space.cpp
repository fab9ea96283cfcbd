#include "model/shape_space.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <utility>

#include "core/error.h"

namespace sole::model {

ShapeSpace LearnShapeSpace(const Eigen::MatrixXd& shapes, Eigen::Index num_components) {
  const Eigen::Index samples = shapes.cols();
  Require(
      samples > num_components,
      fmt::format("shape space: {} components need more than {} shapes", num_components, samples));
  ShapeSpace space;
  space.mean = shapes.rowwise().mean();
  const Eigen::MatrixXd centred = shapes.colwise() - space.mean;
  const double divisor = static_cast<double>(samples - 1);
  // Eigenvectors of the samples' Gram matrix: there are far fewer samples than coordinates.
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(centred.transpose() * centred /
                                                              divisor);
  space.variances = solver.eigenvalues().reverse().head(samples - 1).cwiseMax(0);
  space.components.resize(shapes.rows(), num_components);
  for (Eigen::Index c = 0; c < num_components; ++c) {
    // Length of centred * v is the standard deviation times sqrt(divisor).
    space.components.col(c) =
        centred * solver.eigenvectors().col(samples - 1 - c) / std::sqrt(divisor);
  }
  return space;
}

void AddShapes(const Eigen::MatrixXd& shapes, ShapeSum& sum) {
  const Eigen::Index more = shapes.cols(), size = shapes.rows();
  Require(sum.rank > 0 && (sum.samples == 0 || sum.mean.size() == size),
          "shape space: shapes of another size than those before");
  if (more == 0) return;
  if (sum.samples == 0) {
    sum.mean = Eigen::VectorXd::Zero(size);
    sum.directions.resize(size, 0);
  }
  const Eigen::VectorXd their_mean = shapes.rowwise().mean();
  const Eigen::MatrixXd centred = shapes.colwise() - their_mean;
  const double before = static_cast<double>(sum.samples), after = static_cast<double>(more);
  const Eigen::VectorXd shift = their_mean - sum.mean;
  const double pull = before * after / (before + after);
  const Eigen::Index kept = sum.directions.cols();
  Eigen::MatrixXd all(size, kept + more + 1);
  all << sum.directions, centred, std::sqrt(pull) * shift;
  sum.mean += after / (before + after) * shift;
  sum.scatter += centred.squaredNorm() + pull * shift.squaredNorm();
  sum.samples += more;
  if (all.cols() <= sum.rank) {
    sum.directions = std::move(all);
    return;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(all.transpose() * all);
  sum.directions = all * solver.eigenvectors().rightCols(sum.rank);
}

ShapeSpace LearnShapeSpace(const ShapeSum& sum, Eigen::Index num_components) {
  Require(sum.samples > num_components && num_components <= sum.directions.cols(),
          fmt::format("shape space: {} components need more than {} shapes", num_components,
                      sum.samples));
  const double divisor = static_cast<double>(sum.samples - 1);
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(
      sum.directions.transpose() * sum.directions / divisor);
  const Eigen::Index kept = std::min(sum.directions.cols(), sum.samples - 1);
  ShapeSpace space;
  space.mean = sum.mean;
  space.variances.resize(kept + 1);
  space.variances.head(kept) = solver.eigenvalues().reverse().head(kept).cwiseMax(0);
  space.variances[kept] = std::max(0.0, sum.scatter / divisor - space.variances.head(kept).sum());
  space.components = sum.directions *
                     solver.eigenvectors().rowwise().reverse().leftCols(num_components) /
                     std::sqrt(divisor);
  return space;
}

Rigid3 AlignRigidly(const Eigen::MatrixX3d& from, const Eigen::MatrixX3d& onto,
                    const Eigen::VectorXd& weights) {
  Require(from.rows() == onto.rows() && from.rows() >= 3,
          "rigid alignment: it needs two sets of the same three or more points");
  const Eigen::VectorXd w = weights.size() > 0 ? weights : Eigen::VectorXd::Ones(from.rows());
  const Eigen::RowVector3d centre_from = w.transpose() * from / w.sum(),
                           centre_onto = w.transpose() * onto / w.sum();
  const Eigen::Matrix3d covariance =
      (onto.rowwise() - centre_onto).transpose() * w.asDiagonal() * (from.rowwise() - centre_from);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d rotation = svd.matrixU() * svd.matrixV().transpose();
  if (rotation.determinant() < 0) {
    rotation = svd.matrixU() * Eigen::Vector3d(1, 1, -1).asDiagonal() * svd.matrixV().transpose();
  }
  Rigid3 onto_from;
  onto_from.rotation = Eigen::Quaterniond(rotation).normalized();
  onto_from.translation = centre_onto.transpose() - rotation * centre_from.transpose();
  return onto_from;
}

}  // namespace sole::model
