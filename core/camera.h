#pragma once

#include <string>

#include <Eigen/Core>

#include "core/rigid3.h"

namespace sole {

/// Pinhole camera with Brown-Conrady distortion (OpenCV's order and convention): fx, fy, cx, cy in pixels,
/// k1, k2, p1, p2, k3 dimensionless. Pixel (0, 0) is the centre of the first pixel; the camera looks along
/// its +z, x right, y down.
inline constexpr int kNumIntrinsics = 9;
using Intrinsics = Eigen::Matrix<double, kNumIntrinsics, 1>;

struct Camera {
  std::string serial;
  int width = 0;
  int height = 0;
  Intrinsics intrinsics = Intrinsics::Zero();
  Rigid3 cam_from_world;

  Eigen::Vector3d CentreInWorld() const { return cam_from_world.Inverse().translation; }
};

/// Applies distortion k1 k2 p1 p2 k3 (five values at `k`) to normalised image coordinates.
template <typename T>
Eigen::Matrix<T, 2, 1> Distort(const T* k, const Eigen::Matrix<T, 2, 1>& n) {
  const T x2 = n.x() * n.x(), y2 = n.y() * n.y(), xy = n.x() * n.y();
  const T r2 = x2 + y2;
  const T radial = T(1) + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  return {n.x() * radial + T(2) * k[2] * xy + k[3] * (r2 + T(2) * x2),
          n.y() * radial + k[2] * (r2 + T(2) * y2) + T(2) * k[3] * xy};
}

/// Pixel of a point in the camera frame (z > 0). `intrinsics` holds kNumIntrinsics values.
template <typename T>
Eigen::Matrix<T, 2, 1> PixelFromPointInCam(const T* intrinsics,
                                           const Eigen::Matrix<T, 3, 1>& point_in_cam) {
  const T inverse_depth = T(1) / point_in_cam.z();
  const Eigen::Matrix<T, 2, 1> normalized(point_in_cam.x() * inverse_depth,
                                          point_in_cam.y() * inverse_depth);
  const Eigen::Matrix<T, 2, 1> distorted = Distort(intrinsics + 4, normalized);
  return {intrinsics[0] * distorted.x() + intrinsics[2], intrinsics[1] * distorted.y() + intrinsics[3]};
}

/// Derivative of Distort by its coordinates.
Eigen::Matrix2d DistortJacobian(const double* k, const Eigen::Vector2d& n);

/// Derivatives of PixelFromPointInCam.
struct PixelJacobian {
  Eigen::Matrix<double, 2, 3> point_in_cam;
  Eigen::Matrix<double, 2, kNumIntrinsics> intrinsics;
};
PixelJacobian PixelJacobianAt(const double* intrinsics, const Eigen::Vector3d& point_in_cam);

/// Undistorted normalised coordinates of a pixel, by Newton's method to 1e-12 (inverse of the above).
Eigen::Vector2d NormalizedFromPixel(const Intrinsics& intrinsics, const Eigen::Vector2d& pixel);

}  // namespace sole
