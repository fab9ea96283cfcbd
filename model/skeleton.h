#pragma once

#include <Eigen/Core>
#include <vector>

#include "model/foot_model.h"

namespace sole::model {

/// The posed kinematic tree. World frame = the model's frame shifted by the translation.
struct Skeleton {
  Eigen::Matrix3Xd rest_joints;            ///< 3 x K, of the shaped template
  Eigen::Matrix3Xd joints;                 ///< 3 x K, posed, without the translation
  std::vector<Eigen::Matrix3d> rotations;  ///< K, world from joint
  Eigen::Matrix3Xd
      offsets;  ///< 3 x K: a rest point x on bone k goes to rotations[k] x + offsets[k]
};

/// Poses the tree with theta (K x 3, rad) and beta (at most B values).
Skeleton PoseSkeleton(const FootModel& model, const Eigen::MatrixX3d& theta,
                      const Eigen::VectorXd& beta);

/// 16 x K: columns of each bone's rotation and its offset, each followed by one zero.
Eigen::MatrixXd BoneTransforms(const Skeleton& skeleton);

}  // namespace sole::model
