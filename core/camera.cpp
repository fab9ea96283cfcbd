#include "core/camera.h"

#include <Eigen/LU>

namespace sole {

Eigen::Vector2d NormalizedFromPixel(const Intrinsics& intrinsics, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d distorted((pixel.x() - intrinsics[2]) / intrinsics[0],
                                  (pixel.y() - intrinsics[3]) / intrinsics[1]);
  const double k1 = intrinsics[4], k2 = intrinsics[5], p1 = intrinsics[6], p2 = intrinsics[7],
               k3 = intrinsics[8];
  Eigen::Vector2d n = distorted;
  for (int iteration = 0; iteration < 20; ++iteration) {
    const double x = n.x(), y = n.y(), r2 = x * x + y * y;
    const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
    const double slope = k1 + r2 * (2 * k2 + r2 * 3 * k3);  // d radial / d r2
    const Eigen::Vector2d residual = Distort(intrinsics.data() + 4, n) - distorted;
    Eigen::Matrix2d jacobian;
    jacobian << radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x,
        2 * x * y * slope + 2 * p1 * x + 2 * p2 * y,
        2 * x * y * slope + 2 * p1 * x + 2 * p2 * y,
        radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x;
    const Eigen::Vector2d step = jacobian.inverse() * residual;
    n -= step;
    if (step.squaredNorm() < 1e-24) break;
  }
  return n;
}

}  // namespace sole
