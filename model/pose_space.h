#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace sole::model {

/// How poses are distributed (MANO, section 3.3): principal components of theta without the root,
/// and a mixture of Gaussians in them. Empty where a model has none. P = 3 (K - 1) pose values in
/// joint order, C components, G Gaussians.
struct PoseSpace {
  Eigen::VectorXd mean;        ///< P, rad
  Eigen::MatrixXd components;  ///< P x C, orthonormal columns
  Eigen::VectorXd variances;   ///< P, rad2, of all components, largest first
  Eigen::VectorXd weights;     ///< G, sum 1
  Eigen::MatrixXd means;       ///< G x C, rad
  Eigen::MatrixXd covariances; ///< G x C C, rad2, each row a matrix column by column

  bool Empty() const { return mean.size() == 0; }
};

struct PoseSpaceOptions {
  Eigen::Index components = 10;
  int gaussians = 6;
  int iterations = 100;
  double floor_rad = 0.01;  ///< least standard deviation of a Gaussian
  std::uint64_t seed = 1;
};

/// From one row of pose values (P) a pose. Fewer Gaussians come out where there are too few poses:
/// each needs ten times as many as components. Expectation maximisation from seeded centres
/// (k-means++); deterministic.
PoseSpace LearnPoseSpace(const Eigen::MatrixXd& poses, const PoseSpaceOptions& options = {});

/// Pose values of theta (K x 3): without the root, joint by joint.
Eigen::VectorXd PoseValues(const Eigen::MatrixX3d& theta);

/// Minimum over the Gaussians of -log(weight x density) of a pose in the space of components
/// (model.md, section 5, E_theta), and its derivative in the pose values.
struct PoseEnergy {
  double value = 0;
  Eigen::VectorXd gradient;  ///< P
};
PoseEnergy EnergyOf(const PoseSpace& space, const Eigen::VectorXd& pose_values);

}  // namespace sole::model
