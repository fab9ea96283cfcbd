#pragma once

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <Eigen/Core>

#include "core/plate.h"
#include "core/rigid3.h"

namespace sole::calib {

/// A pose as the adjustment varies it: a block of 6 values d = (rotation vector, translation) about
/// the fixed `reference`, R = exp(d[0..2]) R_ref, t = t_ref + d[3..5]. No manifold is needed and
/// the covariance at d = 0 is that of a small rotation on the left.
inline constexpr int kPoseSize = 6;

template <typename T>
Eigen::Matrix<T, 3, 1> Apply(const Rigid3& reference, const T* d,
                             const Eigen::Matrix<T, 3, 1>& point) {
  const Eigen::Matrix<T, 3, 1> rotated = reference.rotation.cast<T>() * point;
  Eigen::Matrix<T, 3, 1> moved;
  ceres::AngleAxisRotatePoint(d, rotated.data(), moved.data());
  return moved + reference.translation.cast<T>() + Eigen::Map<const Eigen::Matrix<T, 3, 1>>(d + 3);
}

/// Camera centre of cam_from_world varied by d: -R^T t.
template <typename T>
Eigen::Matrix<T, 3, 1> CentreOf(const Rigid3& reference, const T* d) {
  const Eigen::Matrix<T, 3, 1> t =
      reference.translation.cast<T>() + Eigen::Map<const Eigen::Matrix<T, 3, 1>>(d + 3);
  const T inverse[3] = {-d[0], -d[1], -d[2]};
  Eigen::Matrix<T, 3, 1> unrotated;
  ceres::AngleAxisRotatePoint(inverse, t.data(), unrotated.data());
  return -(reference.rotation.conjugate().cast<T>() * unrotated);
}

inline Rigid3 Moved(const Rigid3& reference, const double* d) {
  const Eigen::Vector3d w(d[0], d[1], d[2]);
  const double angle = w.norm();
  Rigid3 moved = reference;
  if (angle > 0) {
    moved.rotation =
        (Eigen::Quaterniond(Eigen::AngleAxisd(angle, w / angle)) * reference.rotation).normalized();
  }
  moved.translation += Eigen::Vector3d(d[3], d[4], d[5]);
  return moved;
}

/// Residual of one image point over its sigma, the exact projection through the plate.
struct RefractedResidual {
  Eigen::Vector2d pixel;
  double sigma_px;
  double index;
  Rigid3 cam_from_world;

  template <typename T>
  bool Evaluate(const T* camera, const T* intrinsics, const T* thickness,
                const Eigen::Matrix<T, 3, 1>& point_in_world, T* residual) const {
    const Eigen::Matrix<T, 3, 1> apparent =
        ApparentPoint<T>(*thickness, T(index), CentreOf(cam_from_world, camera), point_in_world);
    const Eigen::Matrix<T, 3, 1> point_in_cam = Apply(cam_from_world, camera, apparent);
    if (!(point_in_cam.z() > T(1e-3))) return false;
    const Eigen::Matrix<T, 2, 1> projected = PixelFromPointInCam<T>(intrinsics, point_in_cam);
    residual[0] = (projected.x() - pixel.x()) / sigma_px;
    residual[1] = (projected.y() - pixel.y()) / sigma_px;
    return true;
  }
};

/// A corner of the target: camera pose 6, intrinsics 9, target pose 6, thickness 1.
struct TargetResidual {
  RefractedResidual projection;
  Rigid3 world_from_body;
  Eigen::Vector3d point_in_body;

  template <typename T>
  bool operator()(const T* camera, const T* intrinsics, const T* body, const T* thickness,
                  T* residual) const {
    const Eigen::Matrix<T, 3, 1> in_body = point_in_body.cast<T>();
    return projection.Evaluate<T>(camera, intrinsics, thickness,
                                  Apply<T>(world_from_body, body, in_body), residual);
  }
  static ceres::CostFunction* Create(const TargetResidual& residual) {
    return new ceres::AutoDiffCostFunction<TargetResidual, 2, kPoseSize, kNumIntrinsics, kPoseSize,
                                           1>(new TargetResidual(residual));
  }
};

/// A corner of a fiducial on the glass top: camera pose 6, intrinsics 9, offset of the fiducial 2,
/// thickness 1.
struct FiducialResidual {
  RefractedResidual projection;
  Eigen::Vector3d point_in_world;

  template <typename T>
  bool operator()(const T* camera, const T* intrinsics, const T* offset, const T* thickness,
                  T* residual) const {
    const Eigen::Matrix<T, 3, 1> point(point_in_world.x() + offset[0],
                                       point_in_world.y() + offset[1], T(point_in_world.z()));
    return projection.Evaluate<T>(camera, intrinsics, thickness, point, residual);
  }
  static ceres::CostFunction* Create(const FiducialResidual& residual) {
    return new ceres::AutoDiffCostFunction<FiducialResidual, 2, kPoseSize, kNumIntrinsics, 2, 1>(
        new FiducialResidual(residual));
  }
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
