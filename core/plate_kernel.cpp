// Many points at once: the arithmetic of a single one is a chain of divisions and a root that wait
// for each other. Plain arrays and branch-free loops, which the compiler turns into vector
// instructions (this file is compiled with -O3 -fno-math-errno -fno-trapping-math).
#include "core/plate_kernel_internal.h"

#include <cmath>
#include <limits>

namespace sole {

double ProjectWithOneStep(const ProjectorValues& projector, const double* points, double* pixels) {
  const ProjectorValues p = projector;
  const double *r = p.rotation, *k = p.intrinsics;
  const double n2 = p.index * p.index, paraxial = 1 - 1 / p.index;
  double steps[kProjectedAtOnce], result[2 * kProjectedAtOnce];
  for (std::size_t i = 0; i < kProjectedAtOnce; ++i) {
    const double x = points[3 * i], y = points[3 * i + 1], z = points[3 * i + 2];
    const double top = z > p.centre[2] ? z : p.centre[2];
    const double bottom = z > p.centre[2] ? p.centre[2] : z;
    const double height = top - bottom;
    const double per_height = 1 / (height > 1e-12 ? height : 1e-12);
    const double glass_top = top < 0 ? top : 0;
    const double glass_bottom = bottom > -p.thickness_m ? bottom : -p.thickness_m;
    const double glass_m = glass_top - glass_bottom;
    const double glass = (glass_m > 0 ? glass_m : 0) * per_height;
    const double dx = x - p.centre[0], dy = y - p.centre[1];
    const double mw = (n2 - 1) * (dx * dx + dy * dy) * per_height * per_height;
    // One step of SolveLateralScale (core/plate.cpp); without glass it starts at the solution.
    const double air = 1 - glass, rise = glass * paraxial, start = 1 + rise * (1 + rise);
    const double mws2 = mw * start * start;
    const double inverse = 1 / std::sqrt(n2 + mws2), inverse2 = inverse * inverse;
    const double cube = glass * n2 * inverse2 * inverse;
    const double f = start * (air + glass * inverse) - 1, d1 = air + cube;
    const double fifth = -3 * mw * cube * inverse2, d2 = fifth * start;
    const double d3 = fifth * (1 - 5 * mws2 * inverse2);
    const double step =
        f * (d1 * d1 - 0.5 * f * d2) / (d1 * (d1 * d1 - f * d2) + f * f * d3 * (1.0 / 6));
    steps[i] = step;
    const double ax = p.centre[0] + dx * (start - step), ay = p.centre[1] + dy * (start - step);
    const double depth = r[6] * ax + r[7] * ay + r[8] * z + p.translation[2];
    const double per_depth =
        depth > 0 ? 1 / depth : std::numeric_limits<double>::quiet_NaN();
    const double u = (r[0] * ax + r[1] * ay + r[2] * z + p.translation[0]) * per_depth;
    const double v = (r[3] * ax + r[4] * ay + r[5] * z + p.translation[1]) * per_depth;
    // Distort (core/camera.h)
    const double u2 = u * u, v2 = v * v, uv2 = 2 * u * v, r2 = u2 + v2;
    const double radial = 1 + r2 * (k[4] + r2 * (k[5] + r2 * k[8]));
    result[2 * i] = k[0] * (u * radial + k[6] * uv2 + k[7] * (r2 + 2 * u2)) + k[2];
    result[2 * i + 1] = k[1] * (v * radial + k[6] * (r2 + 2 * v2) + k[7] * uv2) + k[3];
  }
  double largest = 0;
  for (std::size_t i = 0; i < kProjectedAtOnce; ++i) {
    pixels[2 * i] = result[2 * i];
    pixels[2 * i + 1] = result[2 * i + 1];
    const double size = std::fabs(steps[i]);
    largest = size <= largest ? largest : size;  // keeps what is not a number
  }
  return largest;
}

}  // namespace sole
