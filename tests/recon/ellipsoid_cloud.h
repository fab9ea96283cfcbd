#pragma once

#include <cmath>
#include <numbers>

#include "core/point_cloud.h"

namespace sole::testing_support {

/// Points about `spacing_m` apart on an ellipsoid with axes along the world's, with exact normals.
inline PointCloud EllipsoidCloud(const Eigen::Vector3d& centre, const Eigen::Vector3d& radii,
                                 double spacing_m) {
  PointCloud cloud;
  const double golden = std::numbers::pi * (3 - std::sqrt(5.0));
  const double radius = std::cbrt(radii.prod());
  const auto count = static_cast<int>(4 * std::numbers::pi * radius * radius / (spacing_m * spacing_m));
  for (int i = 0; i < count; ++i) {
    const double z = 1 - 2 * (i + 0.5) / count, r = std::sqrt(1 - z * z);
    const Eigen::Vector3d unit(r * std::cos(golden * i), z, r * std::sin(golden * i));
    cloud.points_m.push_back((centre + radii.cwiseProduct(unit)).cast<float>());
    cloud.normals.push_back(unit.cwiseQuotient(radii).normalized().cast<float>());
    cloud.sigma_m.push_back(5e-5F);
    cloud.intensity.push_back(static_cast<float>(100 + 80 * z));
  }
  return cloud;
}

}  // namespace sole::testing_support
