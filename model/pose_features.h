#pragma once

#include <Eigen/Core>

#include "model/foot_model.h"

namespace sole::model {

/// Number P of pose features of a model with `num_joints` joints.
Eigen::Index NumPoseFeatures(Family family, Eigen::Index num_joints);

/// Rotation matrix of an axis-angle vector (rad), right-handed.
Eigen::Matrix3d RotationFrom(const Eigen::Vector3d& theta);

/// Left Jacobian of SO(3): exp(theta + d) = exp(Jl d) exp(theta) to first order.
Eigen::Matrix3d LeftJacobian(const Eigen::Vector3d& theta);

/// Quaternion feature (x, y, z, w - 1) of an axis-angle vector and its 4 x 3 derivative.
Eigen::Vector4d QuaternionFeature(const Eigen::Vector3d& theta);
Eigen::Matrix<double, 4, 3> QuaternionFeatureJacobian(const Eigen::Vector3d& theta);

/// Quaternion features of all joints, 4K, root included: the start of the network's input.
Eigen::VectorXd QuaternionFeatures(const Eigen::MatrixX3d& theta);

/// Features of the correctives (P values) for theta (K x 3) and beta (B).
Eigen::VectorXd PoseFeatures(Family family, const Eigen::MatrixX3d& theta,
                             const Eigen::VectorXd& beta);

/// Derivative of the features that depend on joint `joint`: they are the `rows` values from
/// `first`.
struct FeatureBlock {
  Eigen::Index first = 0;
  Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor, 9, 3>
      jacobian;  ///< no rows: no feature
};
FeatureBlock PoseFeatureBlock(Family family, const Eigen::MatrixX3d& theta, Eigen::Index joint);

}  // namespace sole::model
