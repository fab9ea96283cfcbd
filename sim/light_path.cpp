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

LensValue Lens(double k1, double k2, double p1, double p2, double x, double y) {
  const double r2 = x * x + y * y;
  const double stretch = 1 + r2 * (k1 + r2 * k2);
  const double growth = 2 * (k1 + 2 * k2 * r2);
  const double across = growth * x * y + 2 * p1 * x + 2 * p2 * y;
  return {x * stretch + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          y * stretch + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
          stretch + growth * x * x + 2 * p1 * y + 6 * p2 * x,
          across,
          across,
          stretch + growth * y * y + 6 * p1 * y + 2 * p2 * x};
}

}  // namespace

PixelRays::PixelRays(const TrueCamera& c)
    : fx_(c.fx), fy_(c.fy), cx_(c.cx), cy_(c.cy), k1_(c.k1), k2_(c.k2), p1_(c.p1), p2_(c.p2) {
  const Rigid3 world_from_cam = c.cam_from_world.Inverse();
  centre_ = world_from_cam.translation;
  world_from_cam_ = world_from_cam.rotation.toRotationMatrix();
}

PixelRays::Around PixelRays::Near(const Vector2d& pixel) const {
  const double u = (pixel.x() - cx_) / fx_, v = (pixel.y() - cy_) / fy_;
  const double r2 = u * u + v * v;
  double x = u * (1 - k1_ * r2), y = v * (1 - k1_ * r2);
  Eigen::Matrix2d undistort;  // change of x, y per change of u, v
  for (int i = 0; i < 10; ++i) {
    const LensValue lens = Lens(k1_, k2_, p1_, p2_, x, y);
    const double ex = lens.x - u, ey = lens.y - v;
    undistort << lens.dyy, -lens.dxy, -lens.dyx, lens.dxx;
    undistort /= lens.dxx * lens.dyy - lens.dxy * lens.dyx;
    const Vector2d step = undistort * Vector2d(ex, ey);
    x -= step.x();
    y -= step.y();
    if (std::abs(step.x()) + std::abs(step.y()) < 1e-7) break;  // the next would be below 1e-14
  }
  return {centre_, world_from_cam_ * Vector3d(x, y, 1),
          world_from_cam_.leftCols<2>() * undistort.col(0) / fx_,
          world_from_cam_.leftCols<2>() * undistort.col(1) / fy_};
}

LightRay PixelRays::At(const Vector2d& pixel) const {
  return Near(pixel).At(Vector2d::Zero());
}

LightRay RayOfPixel(const TrueCamera& camera, const Vector2d& pixel) {
  return PixelRays(camera).At(pixel);
}

std::optional<Vector2d> PixelOfDirection(const TrueCamera& camera, const Vector3d& towards) {
  const Vector3d d = camera.cam_from_world.rotation * towards;
  if (!(d.z() > 1e-6)) return {};
  const double x = d.x() / d.z(), y = d.y() / d.z();
  if (x * x + y * y > 1.0) return {};  // the polynomial folds back far outside the image
  const LensValue lens = Lens(camera.k1, camera.k2, camera.p1, camera.p2, x, y);
  return Vector2d(camera.fx * lens.x + camera.cx, camera.fy * lens.y + camera.cy);
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
  // Snell's law at each face, whose normals are the z axis.
  const double ratio = 1 / plate.index, up = upwards ? 1 : -1;
  Vector3d inside = ratio * ray.direction;
  inside.z() = up * std::sqrt(1 - inside.head<2>().squaredNorm());
  crossing.far_point = AtHeight({crossing.near_point, inside}, far_z);
  Vector3d outside = plate.index * inside;
  const double cosine2 = 1 - outside.head<2>().squaredNorm();
  if (!(cosine2 > 0) || !OnFace(plate, crossing.far_point)) {
    crossing.kind = PlateCrossing::Kind::kEdge;
    return crossing;
  }
  outside.z() = up * std::sqrt(cosine2);
  crossing.kind = PlateCrossing::Kind::kThrough;
  crossing.direction = outside;
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
  // A point a little below the top lies on glass that sagged, all of it: less air, as much glass.
  const double air = high - low - t, n2 = plate.index * plate.index;
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
