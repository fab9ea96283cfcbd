#pragma once

#include <tbb/parallel_for.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <random>

#include "core/image.h"
#include "core/rig.h"
#include "core/rig_config.h"

/// Speckled analytic surfaces, ray traced through the glass with the vector form of Snell's law at
/// each face: exact truth that shares no refraction code with what it checks.
namespace sole::testing_support {

/// Grey value 0..1 of a solid speckle pattern: smooth noise on a lattice of `cell_m`.
inline double SolidSpeckle(const Eigen::Vector3d& p, double cell_m) {
  const Eigen::Vector3d q = p / cell_m + Eigen::Vector3d::Constant(1e4);
  const Eigen::Array3d base = q.array().floor();
  Eigen::Array3d f = q.array() - base;
  f = f * f * (3 - 2 * f);
  double value = 0;
  for (unsigned corner = 0; corner < 8; ++corner) {
    std::uint64_t hash = 0x9E3779B97F4A7C15ULL;
    double weight = 1;
    for (int axis = 0; axis < 3; ++axis) {
      const unsigned bit = (corner >> axis) & 1U;
      hash ^= static_cast<std::uint64_t>(base[axis]) + bit;
      hash *= 0xBF58476D1CE4E5B9ULL;
      hash ^= hash >> 29;
      weight *= bit != 0U ? f[axis] : 1 - f[axis];
    }
    hash *= 0x94D049BB133111EBULL;
    value += weight * static_cast<double>(hash >> 40) / 16777216.0;
  }
  // More contrast than plain noise has.
  const double x = std::clamp((value - 0.5) * 1.8 + 0.5, 0.0, 1.0);
  return x * x * (3 - 2 * x);
}

/// A surface: distance along a ray (world frame, above the glass) to the first hit, and the signed
/// distance of a point from it.
struct Surface {
  std::function<std::optional<double>(const Eigen::Vector3d&, const Eigen::Vector3d&)> hit;
  std::function<double(const Eigen::Vector3d&)> distance;
};

/// Plane z = offset + slope_x x + slope_y y over |x| < half_x, |y| < half_y.
inline Surface SlantedPlane(double offset_m, double slope_x, double slope_y, double half_x,
                            double half_y) {
  const Eigen::Vector3d normal = Eigen::Vector3d(-slope_x, -slope_y, 1);
  return {[=](const Eigen::Vector3d& o, const Eigen::Vector3d& d) -> std::optional<double> {
            const double t = (offset_m - normal.dot(o)) / normal.dot(d);
            const Eigen::Vector3d p = o + t * d;
            if (!(t > -1e-9) || std::abs(p.x()) > half_x || std::abs(p.y()) > half_y) return {};
            return t;
          },
          [=](const Eigen::Vector3d& p) { return (normal.dot(p) - offset_m) / normal.norm(); }};
}

/// Ellipsoid with axes along the world's.
inline Surface Ellipsoid(const Eigen::Vector3d& centre, const Eigen::Vector3d& radii) {
  return {[=](const Eigen::Vector3d& o, const Eigen::Vector3d& d) -> std::optional<double> {
            const Eigen::Vector3d a = (o - centre).cwiseQuotient(radii), b = d.cwiseQuotient(radii);
            const double bb = b.squaredNorm(), ab = a.dot(b), aa = a.squaredNorm() - 1;
            const double root = ab * ab - bb * aa;
            if (!(root > 0)) return {};
            const double t = (-ab - std::sqrt(root)) / bb;
            return t > 0 ? std::optional(t) : std::nullopt;
          },
          [=](const Eigen::Vector3d& p) {  // first order; exact to d^2 / radius
            const Eigen::Vector3d a = (p - centre).cwiseQuotient(radii);
            const Eigen::Vector3d gradient = a.cwiseQuotient(radii);
            const double f = 0.5 * (a.squaredNorm() - 1);
            return f / gradient.norm();
          }};
}

/// The first hit of several surfaces.
inline Surface Union(Surface a, Surface b) {
  return {[=](const Eigen::Vector3d& o, const Eigen::Vector3d& d) -> std::optional<double> {
            const auto ta = a.hit(o, d), tb = b.hit(o, d);
            if (ta && tb) return std::min(*ta, *tb);
            return ta ? ta : tb;
          },
          [=](const Eigen::Vector3d& p) {
            const double da = a.distance(p), db = b.distance(p);
            return std::abs(da) < std::abs(db) ? da : db;
          }};
}

/// Direction after a face with unit normal `n` against the ray; eta = index before / index behind.
inline Eigen::Vector3d Refract(const Eigen::Vector3d& d, const Eigen::Vector3d& n, double eta) {
  const double c = -n.dot(d);
  return eta * d + (eta * c - std::sqrt(1 - eta * eta * (1 - c * c))) * n;
}

/// World ray of a pixel, beyond the glass for a camera below it.
inline void TracePixel(const Camera& camera, const Plate& plate, double x, double y,
                       Eigen::Vector3d& origin, Eigen::Vector3d& direction) {
  const Intrinsics& k = camera.intrinsics;
  const Eigen::Vector2d distorted((x - k[2]) / k[0], (y - k[3]) / k[1]);
  Eigen::Vector2d n = distorted;
  for (int i = 0; i < 12; ++i) n += distorted - Distort(k.data() + 4, n);
  const Rigid3 world_from_cam = camera.cam_from_world.Inverse();
  origin = world_from_cam.translation;
  direction = (world_from_cam.rotation * n.homogeneous()).normalized();
  if (origin.z() > -plate.thickness_m || direction.z() <= 0) return;
  const Eigen::Vector3d down(0, 0, -1);
  origin += direction * ((-plate.thickness_m - origin.z()) / direction.z());
  direction = Refract(direction, down, 1 / plate.index);
  origin += direction * (-origin.z() / direction.z());
  direction = Refract(direction, down, plate.index);
}

struct SceneOptions {
  double cell_m = 0.0007;
  double noise = 2;             ///< grey levels, standard deviation
  double background = 3;        ///< grey level where nothing is hit
  double low = 25, high = 200;  ///< grey levels of the speckle
  int samples = 2;              ///< per pixel and axis
  std::uint64_t seed = 1;
};

/// Grey levels before they are rounded.
inline ImageF RenderSpeckleLevels(const Camera& camera, const Plate& plate, const Surface& surface,
                                  const SceneOptions& options = {}) {
  ImageF image(camera.width, camera.height);
  tbb::parallel_for(0, camera.height, [&](int y) {
    std::mt19937_64 engine(options.seed * 1000003 + static_cast<std::uint64_t>(y));
    std::normal_distribution<double> noise(0, 1);
    for (int x = 0; x < camera.width; ++x) {
      double sum = 0;
      for (int s = 0; s < options.samples * options.samples; ++s) {
        const double dx = (s % options.samples + 0.5) / options.samples - 0.5;
        const double dy = (s / options.samples + 0.5) / options.samples - 0.5;
        Eigen::Vector3d origin, direction;
        TracePixel(camera, plate, x + dx, y + dy, origin, direction);
        const auto t = surface.hit(origin, direction);
        sum += t ? options.low + (options.high - options.low) *
                                     SolidSpeckle(origin + *t * direction, options.cell_m)
                 : options.background;
      }
      image.At(x, y) = static_cast<float>(sum / (options.samples * options.samples) +
                                          options.noise * noise(engine));
    }
  });
  return image;
}

inline ImageU8 RenderSpeckle(const Camera& camera, const Plate& plate, const Surface& surface,
                             const SceneOptions& options = {}) {
  const ImageF levels = RenderSpeckleLevels(camera, plate, surface, options);
  ImageU8 image(camera.width, camera.height);
  std::transform(levels.pixels.begin(), levels.pixels.end(), image.pixels.begin(), [](float grey) {
    return static_cast<std::uint8_t>(std::clamp(std::lround(grey), 0L, 255L));
  });
  return image;
}

/// A calibrated rig as the rig file describes it, with a little lens distortion.
inline Rig NominalRig(const RigConfig& config) {
  Rig rig;
  for (const CameraConfig& c : config.cameras) {
    Camera camera;
    camera.serial = c.serial;
    camera.width = c.width;
    camera.height = c.height;
    camera.intrinsics << c.focal_px, c.focal_px * 1.001, 0.5 * c.width + 3, 0.5 * c.height - 4,
        -0.08, 0.1, 2e-4, -3e-4, 0;
    camera.cam_from_world = NominalCamFromWorld(c);
    rig.cameras.push_back(camera);
  }
  for (const PairConfig& p : config.pairs) {
    rig.pairs.push_back({p.name, CameraIndex(config, p.left), CameraIndex(config, p.right)});
  }
  rig.plate = {config.plate.thickness_m, config.plate.index};
  return rig;
}

}  // namespace sole::testing_support
