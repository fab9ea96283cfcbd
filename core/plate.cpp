#include "core/plate.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/plate_kernel_internal.h"

namespace sole {

namespace {

/// What lies between two heights: their distance and the glass in it, with the glass's derivatives.
struct Path {
  double height, glass;
  double glass_by_top, glass_by_bottom, glass_by_thickness;
};

Path PathBetween(double top, double bottom, double thickness) {
  const double glass = std::min(top, 0.0) - std::max(bottom, -thickness);
  return {top - bottom, glass, top < 0 ? 1.0 : 0.0, bottom > -thickness ? -1.0 : 0.0,
          bottom > -thickness ? 0.0 : 1.0};
}

struct LateralScale {
  double scale;       ///< apparent over true lateral distance
  double slope;       ///< of the true lateral distance per height by the tangent in air
  double inverse;     ///< 1 / sqrt(n^2 + (n^2 - 1) q^2)
};

/// With the share `glass` of the height in glass and `w` the square of the lateral distance over the
/// height, solves scale (1 - glass + glass / sqrt(n^2 + m w scale^2)) = 1 by Householder's method of
/// third order from the series of the solution for w = 0. A step below kOneStepSuffices,
/// the usual first one, leaves less than 1e-11.
inline LateralScale SolveLateralScale(double glass, double w, double index) {
  const double n2 = index * index, mw = (n2 - 1) * w, air = 1 - glass;
  const double rise = glass * (1 - 1 / index);
  LateralScale s{1 + rise * (1 + rise), 1, 1};
  for (int i = 0; i < 12; ++i) {
    const double mws2 = mw * s.scale * s.scale;
    s.inverse = 1 / std::sqrt(n2 + mws2);
    const double inverse2 = s.inverse * s.inverse, cube = glass * n2 * inverse2 * s.inverse;
    const double f = s.scale * (air + glass * s.inverse) - 1;
    const double d1 = air + cube;
    const double fifth = mw * cube * inverse2;
    const double d2 = -3 * fifth * s.scale, d3 = -3 * fifth * (1 - 5 * mws2 * inverse2);
    const double step = f * (d1 * d1 - 0.5 * f * d2) / (d1 * (d1 * d1 - f * d2) + f * f * d3 * (1.0 / 6));
    s.scale -= step;
    s.slope = d1;
    if (std::abs(step) < kOneStepSuffices) break;
  }
  return s;
}

}  // namespace

Eigen::Vector3d ApparentPoint(const Plate& plate, const Eigen::Vector3d& centre,
                              const Eigen::Vector3d& point, ApparentPointJacobian* jacobian) {
  const bool from_below = centre.z() < point.z();
  const Path path = from_below ? PathBetween(point.z(), centre.z(), plate.thickness_m)
                               : PathBetween(centre.z(), point.z(), plate.thickness_m);
  if (!(path.glass > 0)) {
    if (jacobian) {
      jacobian->point = Eigen::Matrix<double, 2, 3>::Identity();
      jacobian->centre.setZero();
      jacobian->thickness_m.setZero();
    }
    return point;
  }
  // The lateral direction as a tangent, so that nothing is divided by a distance that may be zero.
  const Eigen::Vector2d lateral = (point - centre).head<2>(), u = lateral / path.height;
  const double w = u.squaredNorm(), glass = path.glass / path.height;
  LateralScale s = SolveLateralScale(glass, w, plate.index);
  if (jacobian) {
    const double n2 = plate.index * plate.index;
    s.inverse = 1 / std::sqrt(n2 + (n2 - 1) * w * s.scale * s.scale);
    s.slope = 1 - glass + glass * n2 * s.inverse * s.inverse * s.inverse;
    const double along = w > 1e-24 ? (1 / s.slope - s.scale) / w : 0;
    const double by_height = s.scale * (1 - 1 / s.slope);
    const double by_glass = s.scale * (1 - s.inverse) / s.slope;
    const double sign = from_below ? 1 : -1;
    const double glass_by_point = from_below ? path.glass_by_top : path.glass_by_bottom;
    const double glass_by_centre = from_below ? path.glass_by_bottom : path.glass_by_top;
    const Eigen::Matrix2d across =
        s.scale * Eigen::Matrix2d::Identity() + along * u * u.transpose();
    jacobian->point << across, u * (sign * by_height + glass_by_point * by_glass);
    jacobian->centre << Eigen::Matrix2d::Identity() - across,
        u * (glass_by_centre * by_glass - sign * by_height);
    jacobian->thickness_m = u * (path.glass_by_thickness * by_glass);
  }
  return {centre.x() + lateral.x() * s.scale, centre.y() + lateral.y() * s.scale, point.z()};
}

Projector::Projector(const Camera& camera, const Plate& plate_of_rig)
    : rotation(camera.cam_from_world.rotation.toRotationMatrix()),
      translation(camera.cam_from_world.translation),
      centre(camera.CentreInWorld()),
      intrinsics(camera.intrinsics),
      plate(plate_of_rig) {}

// Scalars instead of ApparentPoint's vector: stored and loaded again it costs as much as the root.
Eigen::Vector2d Projector::operator()(const Eigen::Vector3d& point_in_world) const {
  double x = point_in_world.x(), y = point_in_world.y();
  const double z = point_in_world.z(), top = std::max(z, centre.z()),
               bottom = std::min(z, centre.z());
  const double glass = std::min(top, 0.0) - std::max(bottom, -plate.thickness_m);
  if (glass > 0) {
    const double per_height = 1 / (top - bottom);
    const double dx = x - centre.x(), dy = y - centre.y();
    const double w = (dx * dx + dy * dy) * per_height * per_height;
    const double scale = SolveLateralScale(glass * per_height, w, plate.index).scale;
    x = centre.x() + dx * scale;
    y = centre.y() + dy * scale;
  }
  const Eigen::Vector3d in_cam =
      rotation.col(0) * x + rotation.col(1) * y + rotation.col(2) * z + translation;
  if (!(in_cam.z() > 0)) {
    return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  return PixelFromPointInCam<double>(intrinsics.data(), in_cam);
}

void Projector::operator()(std::span<const Eigen::Vector3d> points_in_world,
                           std::span<Eigen::Vector2d> pixels) const {
  static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double) &&
                sizeof(Eigen::Vector2d) == 2 * sizeof(double));
  ProjectorValues values;
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(values.rotation) = rotation;
  Eigen::Map<Eigen::Vector3d>(values.translation) = translation;
  Eigen::Map<Eigen::Vector3d>(values.centre) = centre;
  Eigen::Map<Intrinsics>(values.intrinsics) = intrinsics;
  values.thickness_m = plate.thickness_m;
  values.index = plate.index;
  std::size_t i = 0;
  for (; i + kProjectedAtOnce <= points_in_world.size(); i += kProjectedAtOnce) {
    const double step =
        ProjectWithOneStep(values, points_in_world[i].data(), pixels[i].data());
    if (step < kOneStepSuffices) continue;
    for (std::size_t j = i; j < i + kProjectedAtOnce; ++j) pixels[j] = (*this)(points_in_world[j]);
  }
  for (; i < points_in_world.size(); ++i) pixels[i] = (*this)(points_in_world[i]);
}

Eigen::Vector2d PixelFromWorld(const Camera& camera, const Plate& plate,
                               const Eigen::Vector3d& point_in_world) {
  return Projector(camera, plate)(point_in_world);
}

Ray RayFromPixel(const Camera& camera, const Plate& plate, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d n = NormalizedFromPixel(camera.intrinsics, pixel);
  const Rigid3 world_from_cam = camera.cam_from_world.Inverse();
  Ray ray{world_from_cam.translation, world_from_cam.rotation * n.homogeneous().normalized()};
  const bool looks_through = ray.origin.z() < -plate.thickness_m && ray.direction.z() > 1e-6;
  if (looks_through) {
    const double cosine = ray.direction.z();
    const double sine2 = 1 - cosine * cosine;
    ray.origin.z() +=
        plate.thickness_m * (1 - cosine / std::sqrt(plate.index * plate.index - sine2));
  }
  return ray;
}

RayIntersection IntersectRays(const Ray& a, const Ray& b) {
  const Eigen::Vector3d w = a.origin - b.origin;
  const double cosine = a.direction.dot(b.direction);
  const double denominator = 1 - cosine * cosine;
  const double da = a.direction.dot(w), db = b.direction.dot(w);
  const double s = (cosine * db - da) / denominator;
  const double t = (db - cosine * da) / denominator;
  const Eigen::Vector3d pa = a.origin + s * a.direction, pb = b.origin + t * b.direction;
  return {0.5 * (pa + pb), (pa - pb).norm()};
}

}  // namespace sole
