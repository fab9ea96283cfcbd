#pragma once

#include <span>

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

/// Derivatives of the x and y of ApparentPoint; its z is the point's own.
struct ApparentPointJacobian {
  Eigen::Matrix<double, 2, 3> point;
  Eigen::Matrix<double, 2, 3> centre;
  Eigen::Vector2d thickness_m;
};

/// The point of the world where `point` appears to stand, seen from `centre` through the plate: the
/// pinhole image of the returned point is the refracted image of `point`. Returned at the height of
/// `point`. Exact: with h and r the perpendicular and lateral distances, g the glass between and q
/// the tangent of the angle in air, r = (h - g) q + g q / sqrt(n^2 + (n^2 - 1) q^2), solved for
/// q h / r by Householder's method to 1e-11. The identity where no glass lies between. Derivatives, if
/// wanted, by the implicit function theorem.
Eigen::Vector3d ApparentPoint(const Plate& plate, const Eigen::Vector3d& centre,
                              const Eigen::Vector3d& point,
                              ApparentPointJacobian* jacobian = nullptr);

/// A camera made ready to project many points.
struct Projector {
  Projector(const Camera& camera, const Plate& plate_of_rig);

  Eigen::Matrix3d rotation;     ///< of cam_from_world
  Eigen::Vector3d translation;  ///< of cam_from_world
  Eigen::Vector3d centre;       ///< in the world
  Intrinsics intrinsics;
  Plate plate;

  /// PixelFromWorld.
  Eigen::Vector2d operator()(const Eigen::Vector3d& point_in_world) const;
  /// The same for many points; `pixels` has their number.
  void operator()(std::span<const Eigen::Vector3d> points_in_world,
                  std::span<Eigen::Vector2d> pixels) const;
};

/// Pixel of a world point seen by `camera`, through the plate where it lies between; not a number
/// for points behind the camera.
Eigen::Vector2d PixelFromWorld(const Camera& camera, const Plate& plate,
                               const Eigen::Vector3d& point_in_world);

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
