#include "core/camera.h"

#include <Eigen/LU>

namespace sole {

Eigen::Matrix2d DistortJacobian(const double* k, const Eigen::Vector2d& n) {
  const double x = n.x(), y = n.y(), r2 = x * x + y * y;
  const double radial = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
  const double slope = 2 * (k[0] + r2 * (2 * k[1] + r2 * 3 * k[4]));  // d radial / d r2, twice
  const double mixed = x * y * slope + 2 * k[2] * x + 2 * k[3] * y;
  Eigen::Matrix2d jacobian;
  jacobian << radial + x * x * slope + 2 * k[2] * y + 6 * k[3] * x, mixed, mixed,
      radial + y * y * slope + 6 * k[2] * y + 2 * k[3] * x;
  return jacobian;
}

PixelJacobian PixelJacobianAt(const double* intrinsics, const Eigen::Vector3d& point_in_cam) {
  const double fx = intrinsics[0], fy = intrinsics[1];
  const double* k = intrinsics + 4;
  const double depth = 1 / point_in_cam.z();
  const double x = point_in_cam.x() * depth, y = point_in_cam.y() * depth;
  const double x2 = x * x, y2 = y * y, xy = x * y, r2 = x2 + y2, r4 = r2 * r2, r6 = r4 * r2;
  const Eigen::Vector2d distorted = Distort(k, Eigen::Vector2d(x, y));
  Eigen::Matrix2d image = DistortJacobian(k, {x, y});
  image.row(0) *= fx * depth;
  image.row(1) *= fy * depth;
  PixelJacobian jacobian;
  jacobian.point_in_cam << image, -image * Eigen::Vector2d(x, y);
  jacobian.intrinsics << distorted.x(), 0, 1, 0, fx * x * r2, fx * x * r4, fx * 2 * xy,
      fx * (r2 + 2 * x2), fx * x * r6,  //
      0, distorted.y(), 0, 1, fy * y * r2, fy * y * r4, fy * (r2 + 2 * y2), fy * 2 * xy,
      fy * y * r6;
  return jacobian;
}

Eigen::Vector2d NormalizedFromPixel(const Intrinsics& intrinsics, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d distorted((pixel.x() - intrinsics[2]) / intrinsics[0],
                                  (pixel.y() - intrinsics[3]) / intrinsics[1]);
  Eigen::Vector2d n = distorted;
  for (int iteration = 0; iteration < 20; ++iteration) {
    const Eigen::Vector2d residual = Distort(intrinsics.data() + 4, n) - distorted;
    const Eigen::Vector2d step =
        DistortJacobian(intrinsics.data() + 4, n).inverse() * residual;
    n -= step;
    if (step.squaredNorm() < 1e-24) break;
  }
  return n;
}

}  // namespace sole
