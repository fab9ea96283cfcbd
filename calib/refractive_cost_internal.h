#pragma once

#include <ceres/autodiff_cost_function.h>
#include <ceres/sized_cost_function.h>

#include <Eigen/Core>

#include "core/camera.h"
#include "core/rigid3.h"

namespace sole::calib {

/// A pose as the adjustment varies it: a block of 6 values d = (rotation vector, translation) about
/// the fixed `reference`, R = exp(d[0..2]) R_ref, t = t_ref + d[3..5]. No manifold is needed and
/// the covariance at d = 0 is that of a small rotation on the left.
inline constexpr int kPoseSize = 6;

Rigid3 Moved(const Rigid3& reference, const double* d);

/// Residual of one image point over its sigma, the exact projection through the plate.
struct RefractedResidual {
  Eigen::Vector2d pixel;
  double sigma_px;
  double index;
  Rigid3 cam_from_world;

  struct Jacobian {
    Eigen::Matrix<double, 2, kPoseSize> camera;
    Eigen::Matrix<double, 2, kNumIntrinsics> intrinsics;
    Eigen::Matrix<double, 2, 3> point_in_world;
    Eigen::Vector2d thickness;
  };

  /// False behind the camera. Derivatives are analytic; `jacobian` may be null.
  bool Evaluate(const double* camera, const double* intrinsics, double thickness,
                const Eigen::Vector3d& point_in_world, double* residual, Jacobian* jacobian) const;
};

/// A corner of the target. Blocks: camera pose 6, intrinsics 9, target pose 6, thickness 1.
class TargetCost final : public ceres::SizedCostFunction<2, kPoseSize, kNumIntrinsics, kPoseSize, 1> {
 public:
  TargetCost(const RefractedResidual& projection, const Rigid3& world_from_body,
             const Eigen::Vector3d& point_in_body);
  bool Evaluate(double const* const* blocks, double* residual, double** jacobians) const override;

 private:
  RefractedResidual projection_;
  Rigid3 world_from_body_;
  Eigen::Vector3d point_in_body_;
};

/// A corner of a fiducial on the glass top. Blocks: camera pose 6, intrinsics 9, offset of the
/// fiducial 2, thickness 1.
class FiducialCost final : public ceres::SizedCostFunction<2, kPoseSize, kNumIntrinsics, 2, 1> {
 public:
  FiducialCost(const RefractedResidual& projection, const Eigen::Vector3d& point_in_world);
  bool Evaluate(double const* const* blocks, double* residual, double** jacobians) const override;

 private:
  RefractedResidual projection_;
  Eigen::Vector3d point_in_world_;
};

/// (x - mean) / sigma of every value of a block.
template <int kSize>
struct Prior {
  Eigen::Matrix<double, kSize, 1> mean;
  double sigma;

  template <typename T>
  bool operator()(const T* x, T* residual) const {
    for (int i = 0; i < kSize; ++i) residual[i] = (x[i] - mean[i]) / sigma;
    return true;
  }
  static ceres::CostFunction* Create(const Eigen::Matrix<double, kSize, 1>& mean, double sigma) {
    return new ceres::AutoDiffCostFunction<Prior, kSize, kSize>(new Prior{mean, sigma});
  }
};

}  // namespace sole::calib
