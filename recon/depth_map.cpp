#include "recon/depth_map.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/error.h"

namespace sole::recon {
namespace {

constexpr double kReachPx = 1.5;  // a point contributes to pixels this near

/// A point in the camera's frame.
struct Splat {
  Eigen::Vector3d point, normal;
  Eigen::Vector2d px;
  double weight = 0, grey = 0;
};

/// The same place without distortion; image and focal length scaled.
Camera PinholeAt(const Camera& camera, double focal_px) {
  const Intrinsics& k = camera.intrinsics;
  const double scale = focal_px / k[0];
  Camera pinhole = camera;
  pinhole.width = std::max(1, static_cast<int>(std::lround(camera.width * scale)));
  pinhole.height = std::max(1, static_cast<int>(std::lround(camera.height * scale)));
  pinhole.intrinsics.setZero();
  pinhole.intrinsics.head<4>() << focal_px, focal_px, (k[2] + 0.5) * scale - 0.5,
      (k[3] + 0.5) * scale - 0.5;
  return pinhole;
}

double MedianDistance(const PointCloud& cloud, const Camera& camera) {
  std::vector<double> distances;
  const Eigen::Vector3d centre = camera.CentreInWorld();
  for (const Eigen::Vector3f& p : cloud.points_m) {
    distances.push_back((p.cast<double>() - centre).norm());
  }
  if (distances.empty()) return 1;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

std::vector<Splat> FacingPoints(const PointCloud& cloud, const Camera& camera, double min_cosine) {
  std::vector<Splat> splats;
  for (std::size_t i = 0; i < cloud.Size(); ++i) {
    Splat s;
    s.point = camera.cam_from_world * Eigen::Vector3d(cloud.points_m[i].cast<double>());
    s.normal = camera.cam_from_world.rotation * Eigen::Vector3d(cloud.normals[i].cast<double>());
    if (!(s.point.z() > 0) || !(-s.normal.dot(s.point.normalized()) > min_cosine)) continue;
    s.px = PixelFromPointInCam<double>(camera.intrinsics.data(), s.point);
    const double sigma = cloud.sigma_m.empty() ? 1 : static_cast<double>(cloud.sigma_m[i]);
    s.weight = 1 / std::max(1e-12, sigma * sigma);
    s.grey = cloud.intensity.empty() ? 128 : static_cast<double>(cloud.intensity[i]);
    splats.push_back(s);
  }
  return splats;
}

/// Calls f(x, y, squared distance) for the pixels around a splat.
template <typename F>
void ForPixels(const Splat& splat, const Camera& camera, double reach, const F& f) {
  if (!(splat.px.cwiseAbs().maxCoeff() < 1e6)) return;
  const int x0 = std::max(0, static_cast<int>(std::ceil(splat.px.x() - reach)));
  const int y0 = std::max(0, static_cast<int>(std::ceil(splat.px.y() - reach)));
  const int x1 = std::min(camera.width - 1, static_cast<int>(std::floor(splat.px.x() + reach)));
  const int y1 = std::min(camera.height - 1, static_cast<int>(std::floor(splat.px.y() + reach)));
  for (int y = y0; y <= y1; ++y) {
    for (int x = x0; x <= x1; ++x) {
      const double d2 = (Eigen::Vector2d(x, y) - splat.px).squaredNorm();
      if (d2 <= reach * reach) f(x, y, d2);
    }
  }
}

/// Depth at which `ray` (z = 1) meets the plane through `point`.
double PlaneDepth(const Eigen::Vector3d& normal, const Eigen::Vector3d& point,
                  const Eigen::Vector3d& ray) {
  return normal.dot(point) / normal.dot(ray);
}

}  // namespace

DepthMap RenderDepthMap(const PointCloud& cloud, const Camera& camera,
                        const DepthMapOptions& options) {
  Require(cloud.normals.size() == cloud.Size(), "a depth map needs a cloud with normals");
  Require(options.spacing_m > 0 && options.focal_px >= 0,
          "depth map: spacing_m must be positive, focal_px not negative");
  const double focal_px = options.focal_px > 0
                              ? options.focal_px
                              : std::min(camera.intrinsics[0],
                                         MedianDistance(cloud, camera) / options.spacing_m);
  DepthMap map;
  map.camera = PinholeAt(camera, focal_px);
  const int width = map.camera.width, height = map.camera.height;
  const std::vector<Splat> splats = FacingPoints(cloud, map.camera, options.min_cosine);

  ImageF front(width, height, std::numeric_limits<float>::infinity());
  for (const Splat& s : splats) {
    ForPixels(s, map.camera, 2 * kReachPx, [&](int x, int y, double) {
      front.At(x, y) = std::min(front.At(x, y), static_cast<float>(s.point.z()));
    });
  }

  struct Sum {
    double weight = 0, depth = 0, grey = 0;
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  };
  std::vector<Sum> sums(front.pixels.size());
  const Intrinsics& k = map.camera.intrinsics;
  /// Calls f(sum, ray, weight) for every pixel on which a point is in front.
  const auto for_visible = [&](const auto& f) {
    for (const Splat& s : splats) {
      ForPixels(s, map.camera, kReachPx, [&](int x, int y, double d2) {
        const Eigen::Vector3d ray((x - k[2]) / k[0], (y - k[3]) / k[1], 1);
        const double step = std::abs(PlaneDepth(s.normal, s.point, ray) - s.point.z());
        const double limit = static_cast<double>(front.At(x, y)) + options.layer_m + 2 * step;
        if (s.point.z() > limit || !(step < 4 * options.layer_m)) return;
        f(s, sums[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                  static_cast<std::size_t>(x)],
          ray, s.weight * std::exp(-2 * d2));
      });
    }
  };
  for_visible([](const Splat& s, Sum& sum, const Eigen::Vector3d&, double weight) {
    sum.weight += weight;
    sum.grey += weight * s.grey;
    sum.normal += weight * s.normal;
  });
  for (Sum& sum : sums) {
    if (sum.weight > 0) sum.normal.normalize();
  }
  // The mean of the normals at both ends carries the depth along a curved surface to second order.
  for_visible([](const Splat& s, Sum& sum, const Eigen::Vector3d& ray, double weight) {
    sum.depth += weight * PlaneDepth(s.normal + sum.normal, s.point, ray);
  });

  map.depth_m = ImageF(width, height);
  map.grey = ImageU8(width, height);
  map.normals.assign(sums.size(), Eigen::Vector3f::Zero());
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const Sum& sum = sums[i];
    if (!(sum.weight > 0)) continue;
    map.depth_m.pixels[i] = static_cast<float>(sum.depth / sum.weight);
    map.grey.pixels[i] =
        static_cast<std::uint8_t>(std::lround(std::clamp(sum.grey / sum.weight, 0.0, 255.0)));
    map.normals[i] = sum.normal.cast<float>();
  }
  return map;
}

}  // namespace sole::recon
