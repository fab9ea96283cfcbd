#include "model/constraints.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <span>

#include "core/error.h"

namespace sole::model {
namespace {

std::span<const Eigen::Vector3d> AxesOf(const FootModel& model, Eigen::Index joint) {
  if (model.constraints.empty()) return {};
  return model.constraints[static_cast<std::size_t>(joint)].axes;
}

/// Product of two quaternions (x, y, z, w).
Eigen::Vector4d Product(const Eigen::Vector4d& a, const Eigen::Vector4d& b) {
  Eigen::Vector4d product;
  product << a[3] * b.head<3>() + b[3] * a.head<3>() + a.head<3>().cross(b.head<3>()),
      a[3] * b[3] - a.head<3>().dot(b.head<3>());
  return product;
}

Eigen::Vector4d Feature(std::span<const Eigen::Vector3d> axes, const Eigen::Vector3d& angles) {
  const Eigen::Vector4d first = QuaternionFeature(angles[0] * axes[0]);
  return axes.size() == 1 ? first : Product(first, QuaternionFeature(angles[1] * axes[1]));
}

}  // namespace

Eigen::Matrix3d LocalRotation(const FootModel& model, const Eigen::MatrixX3d& theta,
                              Eigen::Index joint) {
  const auto axes = AxesOf(model, joint);
  if (axes.empty()) return RotationFrom(theta.row(joint));
  const Eigen::Matrix3d first = RotationFrom(theta(joint, 0) * axes[0]);
  if (axes.size() == 1) return first;
  return first * RotationFrom(theta(joint, 1) * axes[1]);
}

Eigen::Matrix3d TurnAxes(const FootModel& model, const Eigen::MatrixX3d& theta,
                         Eigen::Index joint) {
  const auto axes = AxesOf(model, joint);
  if (axes.empty()) return LeftJacobian(theta.row(joint));
  Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
  turns.col(0) = axes[0];
  if (axes.size() == 2) turns.col(1) = RotationFrom(theta(joint, 0) * axes[0]) * axes[1];
  return turns;
}

Eigen::VectorXd ConstrainedPoseFeatures(const FootModel& model, const Eigen::MatrixX3d& theta,
                                        const Eigen::VectorXd& beta) {
  Eigen::VectorXd features = PoseFeatures(model.family, theta, beta);
  if (model.constraints.empty()) return features;
  for (Eigen::Index j = 0; j < theta.rows(); ++j) {
    const auto axes = AxesOf(model, j);
    if (!axes.empty()) features.segment<4>(4 * j) = Feature(axes, theta.row(j));
  }
  return features;
}

FeatureBlock ConstrainedFeatureBlock(const FootModel& model, const Eigen::MatrixX3d& theta,
                                     Eigen::Index joint) {
  const auto axes = AxesOf(model, joint);
  if (axes.empty()) return PoseFeatureBlock(model.family, theta, joint);
  const Eigen::Vector3d first = theta(joint, 0) * axes[0];
  FeatureBlock block;
  block.first = 4 * joint;
  block.jacobian.setZero(4, 3);
  block.jacobian.col(0) = QuaternionFeatureJacobian(first) * axes[0];
  if (axes.size() == 1) return block;
  const Eigen::Vector3d second = theta(joint, 1) * axes[1];
  block.jacobian.col(0) = Product(block.jacobian.col(0), QuaternionFeature(second));
  block.jacobian.col(1) =
      Product(QuaternionFeature(first), QuaternionFeatureJacobian(second) * axes[1]);
  return block;
}

Eigen::Index NumPoseValues(const FootModel& model) {
  if (model.pose_index.rows() == 0) return 3 * model.NumJoints();
  return model.pose_index.maxCoeff() + 1;
}

Eigen::MatrixX3d ThetaFrom(const FootModel& model, const Eigen::VectorXd& pose) {
  Require(pose.size() == NumPoseValues(model),
          fmt::format("foot model: {} pose values given, the model has {}", pose.size(),
                      NumPoseValues(model)));
  Eigen::MatrixX3d theta = Eigen::MatrixX3d::Zero(model.NumJoints(), 3);
  for (Eigen::Index j = 0; j < theta.rows(); ++j) {
    for (int i = 0; i < 3; ++i) {
      const Eigen::Index at = model.pose_index.rows() == 0 ? 3 * j + i : model.pose_index(j, i);
      if (at >= 0) theta(j, i) = pose[at];
    }
  }
  return theta;
}

}  // namespace sole::model
