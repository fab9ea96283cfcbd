#include "model/skeleton.h"

#include <cstddef>

#include "model/constraints.h"

namespace sole::model {

Skeleton PoseSkeleton(const FootModel& model, const Eigen::MatrixX3d& theta,
                      const Eigen::VectorXd& beta) {
  const Eigen::Index k = model.NumJoints();
  Skeleton skeleton;
  skeleton.rest_joints = model.derived.joints_m.transpose();
  Eigen::Map<Eigen::VectorXd>(skeleton.rest_joints.data(), 3 * k) +=
      model.derived.joint_shapedirs.leftCols(beta.size()) * beta;
  skeleton.joints.resize(3, k);
  skeleton.offsets.resize(3, k);
  skeleton.rotations.resize(static_cast<std::size_t>(k));
  for (Eigen::Index j = 0; j < k; ++j) {
    const auto at = static_cast<std::size_t>(j);
    const Eigen::Matrix3d local = LocalRotation(model, theta, j);
    const int parent = model.parents[at];
    if (parent < 0) {
      skeleton.rotations[at] = local;
      skeleton.joints.col(j) = skeleton.rest_joints.col(j);
    } else {
      const Eigen::Matrix3d& above = skeleton.rotations[static_cast<std::size_t>(parent)];
      skeleton.rotations[at] = above * local;
      skeleton.joints.col(j) = above * skeleton.rest_joints.col(j) + skeleton.offsets.col(parent);
    }
    skeleton.offsets.col(j) =
        skeleton.joints.col(j) - skeleton.rotations[at] * skeleton.rest_joints.col(j);
  }
  return skeleton;
}

Eigen::MatrixXd BoneTransforms(const Skeleton& skeleton) {
  Eigen::MatrixXd transforms(16, skeleton.joints.cols());
  for (Eigen::Index j = 0; j < transforms.cols(); ++j) {
    const Eigen::Matrix3d& rotation = skeleton.rotations[static_cast<std::size_t>(j)];
    for (int c = 0; c < 3; ++c)
      transforms.col(j).segment<4>(4 * c) << rotation.col(c), 0;
    transforms.col(j).tail<4>() << skeleton.offsets.col(j), 0;
  }
  return transforms;
}

}  // namespace sole::model
