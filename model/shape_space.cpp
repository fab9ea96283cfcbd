#include "model/shape_space.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

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
