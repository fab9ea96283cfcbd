#pragma once

#include <Eigen/Core>

#include "model/foot_model.h"
#include "model/pose_features.h"

namespace sole::model {

// Rotations and pose features of a model's joints, with its constraints (see JointConstraint).

/// Rotation of joint `joint` in its parent's frame.
Eigen::Matrix3d LocalRotation(const FootModel& model, const Eigen::MatrixX3d& theta,
                              Eigen::Index joint);

/// Columns: angular velocity of that rotation, in the parent's frame, per value of theta's row.
Eigen::Matrix3d TurnAxes(const FootModel& model, const Eigen::MatrixX3d& theta, Eigen::Index joint);

/// Features of the correctives, as PoseFeatures.
Eigen::VectorXd ConstrainedPoseFeatures(const FootModel& model, const Eigen::MatrixX3d& theta,
                                        const Eigen::VectorXd& beta);

/// Their derivative, as PoseFeatureBlock.
FeatureBlock ConstrainedFeatureBlock(const FootModel& model, const Eigen::MatrixX3d& theta,
                                     Eigen::Index joint);

/// Length of the flat vector of pose values that the model's files speak of: 3K, or fewer where
/// joints are constrained.
Eigen::Index NumPoseValues(const FootModel& model);

/// theta (K x 3) from such a vector. Throws Error if its length is another.
Eigen::MatrixX3d ThetaFrom(const FootModel& model, const Eigen::VectorXd& pose);

}  // namespace sole::model
