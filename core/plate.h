#pragma once

#include <algorithm>
#include <cmath>

#include <Eigen/Core>

#include "core/camera.h"

namespace sole {

/// The glass plate. In the world frame it occupies -thickness_m <= z <= 0; z = 0 is its top surface.
struct Plate {
  double thickness_m = 0.015;
  double index = 1.52;
};

/// A straight ray in the world frame; `direction` has unit length.
struct Ray {
  Eigen::Vector3d origin;
  Eigen::Vector3d direction;
};

/// The point of the world where `point` appears to stand, seen from `centre` through the plate: the pinhole
/// image of the returned point is the refracted image of `point`. Returned at the height of `point`. Exact:
/// with h and r the perpendicular and lateral distances, g the glass between and q the tangent of the angle
/// in air, r = (h - g) q + g q / sqrt(n^2 + (n^2 - 1) q^2), solved by Newton's method (monotone, four steps reach
/// 1e-12 below 60 degrees). The identity where no glass lies between. Scalar-templated for automatic
/// differentiation; derivatives are exact because the last step is taken on T.
template <typename T>
Eigen::Matrix<T, 3, 1> ApparentPoint(const T& thickness_m, const T& index,
                                     const Eigen::Matrix<T, 3, 1>& centre,
                                     const Eigen::Matrix<T, 3, 1>& point) {
  using std::abs;
  using std::sqrt;
  const T top = centre.z() < point.z() ? point.z() : centre.z();
  const T bottom = centre.z() < point.z() ? centre.z() : point.z();
  const T glass_top = top < T(0) ? top : T(0);
  const T glass_bottom = bottom > -thickness_m ? bottom : T(-thickness_m);
  const T glass = glass_top - glass_bottom;
  if (!(glass > T(0))) return point;
  const T dx = point.x() - centre.x(), dy = point.y() - centre.y();
  const T r2 = dx * dx + dy * dy;
  if (!(r2 > T(1e-24))) return point;
  const T r = sqrt(r2);
  const T h = top - bottom;
  const T n2 = index * index;
  T q = r / (h - glass + glass / index);
  for (int i = 0; i < 4; ++i) {
    const T root = sqrt(n2 + (n2 - T(1)) * q * q);
    const T f = (h - glass) * q + glass * q / root - r;
    const T slope = (h - glass) + glass * n2 / (root * root * root);
    q -= f / slope;
  }
  const T scale = q * h / r;
  return {centre.x() + dx * scale, centre.y() + dy * scale, point.z()};
}

/// Pixel of a world point seen by `camera`, through the plate where it lies between.
Eigen::Vector2d PixelFromWorld(const Camera& camera, const Plate& plate, const Eigen::Vector3d& point_in_world);

/// The ray of `pixel`, beyond the plate where the camera looks through it (a camera below looking up): the
/// direction of the pinhole ray, its origin moved along the plate normal by
/// s(a) = t (1 - cos a / sqrt(n^2 - sin^2 a)). For a camera above the plate, the ray in air.
Ray RayFromPixel(const Camera& camera, const Plate& plate, const Eigen::Vector2d& pixel);

/// The point nearest to two rays (midpoint of the common perpendicular) and the distance between them in
/// metres. Parallel rays give a non-finite point.
struct RayIntersection {
  Eigen::Vector3d point;
  double gap_m;
};
RayIntersection IntersectRays(const Ray& a, const Ray& b);

}  // namespace sole
