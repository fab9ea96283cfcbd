#include "sim/light_path.h"

#include <algorithm>
#include <cmath>

namespace sole::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

bool OnFace(const TruePlate& plate, const Vector3d& point) {
  return std::abs(point.x()) <= 0.5 * plate.size_x_m && std::abs(point.y()) <= 0.5 * plate.size_y_m;
}

Vector3d AtHeight(const LightRay& ray, double z) {
  Vector3d point = ray.origin + (z - ray.origin.z()) / ray.direction.z() * ray.direction;
  point.z() = z;
  return point;
}

/// Distorted normalised coordinates and their Jacobian (a, b; b2, d).
struct LensValue {
  double x, y, dxx, dxy, dyx, dyy;
};

LensValue Lens(const TrueCamera& c, double x, double y) {
  const double r2 = x * x + y * y;
  const double stretch = 1 + r2 * (c.k1 + r2 * c.k2);
  const double growth = 2 * (c.k1 + 2 * c.k2 * r2);
  return {x * stretch + 2 * c.p1 * x * y + c.p2 * (r2 + 2 * x * x),
          y * stretch + c.p1 * (r2 + 2 * y * y) + 2 * c.p2 * x * y,
          stretch + growth * x * x + 2 * c.p1 * y + 6 * c.p2 * x,
          growth * x * y + 2 * c.p1 * x + 2 * c.p2 * y,
          growth * x * y + 2 * c.p1 * x + 2 * c.p2 * y,
          stretch + growth * y * y + 6 * c.p1 * y + 2 * c.p2 * x};
}

}  // namespace

LightRay RayOfPixel(const TrueCamera& camera, const Vector2d& pixel) {
  const double u = (pixel.x() - camera.cx) / camera.fx, v = (pixel.y() - camera.cy) / camera.fy;
  const double r2 = u * u + v * v;
  double x = u * (1 - camera.k1 * r2), y = v * (1 - camera.k1 * r2);
  for (int i = 0; i < 10; ++i) {
    const LensValue lens = Lens(camera, x, y);
    const double ex = lens.x - u, ey = lens.y - v;
    const double det = lens.dxx * lens.dyy - lens.dxy * lens.dyx;
    const double sx = (lens.dyy * ex - lens.dxy * ey) / det,
                 sy = (lens.dxx * ey - lens.dyx * ex) / det;
    x -= sx;
    y -= sy;
    if (std::abs(sx) + std::abs(sy) < 1e-9) break;  // the next step would be below 1e-16
  }
  const Rigid3 world_from_cam = camera.cam_from_world.Inverse();
  return {world_from_cam.translation, world_from_cam.rotation * Vector3d(x, y, 1).normalized()};
}

std::optional<Vector2d> PixelOfDirection(const TrueCamera& camera, const Vector3d& towards) {
  const Vector3d d = camera.cam_from_world.rotation * towards;
  if (!(d.z() > 1e-6)) return {};
  const double x = d.x() / d.z(), y = d.y() / d.z();
  if (x * x + y * y > 1.0) return {};  // the polynomial folds back far outside the image
  const LensValue lens = Lens(camera, x, y);
  return Vector2d(camera.fx * lens.x + camera.cx, camera.fy * lens.y + camera.cy);
}

std::optional<Vector3d> Refract(const Vector3d& direction, const Vector3d& normal, double ratio) {
  const double cosine = -normal.dot(direction);
  const double behind2 = 1 - ratio * ratio * (1 - cosine * cosine);
  if (behind2 < 0) return {};
  return Vector3d(ratio * direction + (ratio * cosine - std::sqrt(behind2)) * normal).normalized();
}

double FresnelReflectance(double cosine, double ratio) {
  const double sine2 = (1 - cosine * cosine) / (ratio * ratio);
  if (sine2 >= 1) return 1;
  const double behind = std::sqrt(1 - sine2);
  const double s = (cosine - ratio * behind) / (cosine + ratio * behind);
  const double p = (ratio * cosine - behind) / (ratio * cosine + behind);
  return 0.5 * (s * s + p * p);
}

PlateCrossing CrossPlate(const TruePlate& plate, const LightRay& ray) {
  PlateCrossing crossing;
  const bool upwards = ray.direction.z() > 0;
  const double near_z = upwards ? -plate.thickness_m : 0, far_z = upwards ? 0 : -plate.thickness_m;
  if (std::abs(ray.direction.z()) < 1e-9) return crossing;
  if (upwards ? ray.origin.z() > near_z : ray.origin.z() < near_z)
    return crossing;  // it leads away
  crossing.near_point = AtHeight(ray, near_z);
  if (!OnFace(plate, crossing.near_point)) {
    if (OnFace(plate, AtHeight(ray, far_z))) crossing.kind = PlateCrossing::Kind::kEdge;
    return crossing;
  }
  const Vector3d normal(0, 0, upwards ? -1 : 1);
  const Vector3d inside = *Refract(ray.direction, normal, 1 / plate.index);
  crossing.far_point = AtHeight({crossing.near_point, inside}, far_z);
  const std::optional<Vector3d> outside = Refract(inside, normal, plate.index);
  if (!outside || !OnFace(plate, crossing.far_point)) {
    crossing.kind = PlateCrossing::Kind::kEdge;
    return crossing;
  }
  crossing.kind = PlateCrossing::Kind::kThrough;
  crossing.direction = *outside;
  crossing.near_transmittance = 1 - FresnelReflectance(std::abs(ray.direction.z()), plate.index);
  crossing.far_transmittance = 1 - FresnelReflectance(std::abs(inside.z()), 1 / plate.index);
  return crossing;
}

LightPath PathBetween(const TruePlate& plate, const Vector3d& from, const Vector3d& to) {
  LightPath path;
  const Vector3d span = to - from;
  const double low = std::min(from.z(), to.z()), high = std::max(from.z(), to.z());
  const double t = plate.thickness_m;
  path.length_m = span.norm();
  path.leaving = path.arriving = span / path.length_m;
  if (low > -t || high <= -t) return path;  // both on one side
  const double lateral = std::hypot(span.x(), span.y());
  const double air = std::max(high, 0.0) - low - t, n2 = plate.index * plate.index;
  const auto excess = [&](double s) {
    return air * s / std::sqrt(1 - s * s) + t * s / std::sqrt(n2 - s * s) - lateral;
  };
  // Bracket: zero is too small, the sine of the straight line through all that air too large.
  double a = 0, fa = -lateral, b = std::min(1 - 1e-12, lateral / std::hypot(lateral, air)),
         fb = excess(b);
  double sine = b, f = fb;
  for (int i = 0, last = 0; i < 100 && std::abs(f) > 1e-14 && b - a > 1e-16; ++i) {
    sine = (a * fb - b * fa) / (fb - fa);
    if (!(sine > a && sine < b)) sine = 0.5 * (a + b);
    f = excess(sine);
    const int side = f > 0 ? 1 : -1;
    if (side > 0) {
      b = sine;
      fb = f;
    } else {
      a = sine;
      fa = f;
    }
    if (side == last) (side > 0 ? fa : fb) *= 0.5;  // Illinois: the bracket shrinks from both ends
    last = side;
  }
  Vector3d direction(0, 0, std::copysign(std::sqrt(1 - sine * sine), span.z()));
  if (lateral > 0) direction.head<2>() = span.head<2>() * (sine / lateral);
  const PlateCrossing crossing = CrossPlate(plate, {from, direction});
  path.leaving = path.arriving = direction;
  path.clear = crossing.kind == PlateCrossing::Kind::kThrough;
  path.transmittance = crossing.near_transmittance * crossing.far_transmittance;
  return path;
}

}  // namespace sole::sim
