#include "recon/rectify.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "core/error.h"

namespace sole::recon {
namespace {

constexpr int kSamplesPerAxis = 25;
constexpr float kNoPixel = -1e4F;

bool InImage(const Camera& camera, const Eigen::Vector2d& px) {
  return px.x() >= 0 && px.y() >= 0 && px.x() <= camera.width - 1 && px.y() <= camera.height - 1;
}

/// Points of the volume that the camera sees.
std::vector<Eigen::Vector3d> SampleVolume(const CaptureVolume& volume, double top_m) {
  std::vector<Eigen::Vector3d> points;
  const Eigen::Vector3d max(volume.max_m.x(), volume.max_m.y(), std::min(volume.max_m.z(), top_m));
  const Eigen::Vector3d step = (max - volume.min_m) / (kSamplesPerAxis - 1);
  for (int i = 0; i < kSamplesPerAxis; ++i) {
    for (int j = 0; j < kSamplesPerAxis; ++j) {
      for (int k = 0; k < kSamplesPerAxis; ++k) {
        points.push_back(volume.min_m + step.cwiseProduct(Eigen::Vector3d(i, j, k)));
      }
    }
  }
  return points;
}

/// The point nearest to the rays of all samples, beyond the glass: the camera's centre in air.
Eigen::Vector3d PinholeCentre(const Camera& camera, const Plate& plate,
                              const std::vector<Eigen::Vector3d>& samples) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  int seen = 0;
  for (const Eigen::Vector3d& point : samples) {
    const Eigen::Vector2d px = PixelFromWorld(camera, plate, point);
    if (!InImage(camera, px)) continue;
    const Ray ray = RayFromPixel(camera, plate, px);
    const Eigen::Matrix3d across =
        Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    a += across;
    b += across * ray.origin;
    ++seen;
  }
  return seen < 8 ? camera.CentreInWorld() : Eigen::Vector3d(a.ldlt().solve(b));
}

void FillMaps(const Rectification& rectification, RectifiedView& view) {
  view.map_x = ImageF(rectification.width, rectification.height, kNoPixel);
  view.map_y = view.map_x;
  tbb::parallel_for(0, rectification.height, [&](int y) {
    for (int x = 0; x < rectification.width; ++x) {
      const Eigen::Vector2d raw = RawFromRectified(rectification, view, Eigen::Vector2d(x, y));
      if (!raw.allFinite() || raw.cwiseAbs().maxCoeff() > 9e3) continue;
      view.map_x.At(x, y) = static_cast<float>(raw.x());
      view.map_y.At(x, y) = static_cast<float>(raw.y());
    }
  });
}

/// Rotation whose x is the baseline and whose z lies nearest to both cameras' views.
Eigen::Matrix3d CommonRotation(const RectifiedView& left, const RectifiedView& right,
                               const std::string& pair) {
  const Eigen::Vector3d baseline = right.centre_m - left.centre_m;
  Require(baseline.norm() > 1e-4,
          "pair '" + pair + "': its cameras stand at one place; check the rig and the calibration");
  const Eigen::Vector3d x = baseline.normalized();
  const auto forward = [](const RectifiedView& view) {
    return Eigen::Vector3d(view.camera.cam_from_world.rotation.conjugate() *
                           Eigen::Vector3d::UnitZ());
  };
  const Eigen::Vector3d mean = forward(left) + forward(right);
  const Eigen::Vector3d z = mean - x * x.dot(mean);
  Require(
      z.norm() > 0.5 && forward(left).dot(forward(right)) > 0.3,
      "pair '" + pair + "': its cameras look along their baseline or apart; choose another pair");
  Eigen::Matrix3d rotation;
  rotation.row(0) = x;
  rotation.row(2) = z.normalized();
  rotation.row(1) = z.normalized().cross(x);
  return rotation;
}

}  // namespace

Eigen::Vector2d RectifiedFromWorld(const Rectification& rectification, const RectifiedView& view,
                                   const Eigen::Vector3d& point_in_world) {
  const Eigen::Vector3d p = rectification.rect_from_world * (point_in_world - view.centre_m);
  if (!(p.z() > 0)) return Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  return p.head<2>() * (rectification.focal_px / p.z()) - view.origin_px;
}

Eigen::Vector2d RectifiedFromRaw(const Rectification& rectification, const RectifiedView& view,
                                 const Eigen::Vector2d& raw_px) {
  const Ray ray = RayFromPixel(view.camera, rectification.plate, raw_px);
  if (!view.through_plate) {
    return RectifiedFromWorld(rectification, view, view.centre_m + ray.direction);
  }
  const double along = (rectification.mid_height_m - ray.origin.z()) / ray.direction.z();
  return RectifiedFromWorld(rectification, view, ray.origin + along * ray.direction);
}

Eigen::Vector2d RawFromRectified(const Rectification& rectification, const RectifiedView& view,
                                 const Eigen::Vector2d& rectified_px) {
  const Eigen::Vector2d plane_px = rectified_px + view.origin_px;
  const Eigen::Vector3d direction =
      rectification.rect_from_world.transpose() *
      Eigen::Vector3d(plane_px.x(), plane_px.y(), rectification.focal_px).normalized();
  const Eigen::Vector2d none = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  if (view.through_plate) {
    if (!(direction.z() > 1e-3)) return none;
    const double along = (rectification.mid_height_m - view.centre_m.z()) / direction.z();
    return PixelFromWorld(view.camera, rectification.plate, view.centre_m + along * direction);
  }
  const Eigen::Vector3d in_cam = view.camera.cam_from_world.rotation * direction;
  if (!(in_cam.z() > 0)) return none;
  return PixelFromPointInCam<double>(view.camera.intrinsics.data(), in_cam);
}

Eigen::Vector2d LookUpRaw(const RectifiedView& view, const Eigen::Vector2d& rectified_px) {
  const Eigen::Vector2d none = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  if (!(rectified_px.x() >= 0 && rectified_px.y() >= 0)) return none;
  const int x = static_cast<int>(rectified_px.x()), y = static_cast<int>(rectified_px.y());
  if (x + 1 >= view.map_x.width || y + 1 >= view.map_x.height) return none;
  const double fx = rectified_px.x() - x, fy = rectified_px.y() - y;
  const auto blend = [&](const ImageF& map) {
    const double top =
        (1 - fx) * static_cast<double>(map.At(x, y)) + fx * static_cast<double>(map.At(x + 1, y));
    const double low = (1 - fx) * static_cast<double>(map.At(x, y + 1)) +
                       fx * static_cast<double>(map.At(x + 1, y + 1));
    return (1 - fy) * top + fy * low;
  };
  return {blend(view.map_x), blend(view.map_y)};
}

Rectification Rectify(const Rig& rig, const StereoPair& pair, const RectifyOptions& options) {
  const auto count = static_cast<int>(rig.cameras.size());
  Require(pair.left >= 0 && pair.left < count && pair.right >= 0 && pair.right < count,
          "pair '" + pair.name + "' names a camera that the rig does not have");
  Rectification result;
  result.plate = rig.plate;
  result.mid_height_m = options.mid_height_m;
  const auto make_view = [&](int index) {
    RectifiedView view;
    view.camera = rig.cameras[static_cast<std::size_t>(index)];
    view.through_plate = LooksThroughPlate(view.camera, rig.plate);
    view.origin_px.setZero();
    return view;
  };
  result.left = make_view(pair.left);
  result.right = make_view(pair.right);
  const bool glass = result.left.through_plate || result.right.through_plate;
  const double top_m = glass ? options.volume.max_height_through_glass_m : options.volume.max_m.z();
  const std::vector<Eigen::Vector3d> samples = SampleVolume(options.volume, top_m);
  result.left.centre_m = PinholeCentre(result.left.camera, rig.plate, samples);
  result.right.centre_m = PinholeCentre(result.right.camera, rig.plate, samples);
  result.rect_from_world = CommonRotation(result.left, result.right, pair.name);
  const double focal_px = 0.25 * (result.left.camera.intrinsics.head<2>().sum() +
                                  result.right.camera.intrinsics.head<2>().sum());
  result.focal_px = std::clamp(options.min_focal_px, options.scale * focal_px, focal_px);

  // Extent of the volume in both views, and of its disparities.
  const double inf = std::numeric_limits<double>::infinity();
  Eigen::Vector2d low(inf, inf), high(-inf, -inf);
  double min_disparity = inf, max_disparity = -inf;
  for (const Eigen::Vector3d& point : samples) {
    if (!InImage(result.left.camera, PixelFromWorld(result.left.camera, rig.plate, point)) ||
        !InImage(result.right.camera, PixelFromWorld(result.right.camera, rig.plate, point))) {
      continue;
    }
    const Eigen::Vector2d l = RectifiedFromWorld(result, result.left, point);
    const Eigen::Vector2d r = RectifiedFromWorld(result, result.right, point);
    if (!l.allFinite() || !r.allFinite()) continue;
    low = low.cwiseMin(l);
    high = high.cwiseMax(l);
    min_disparity = std::min(min_disparity, l.x() - r.x());
    max_disparity = std::max(max_disparity, l.x() - r.x());
  }
  Require(std::isfinite(min_disparity),
          "pair '" + pair.name +
              "': its cameras share no part of the capture volume; check "
              "their poses");
  const double first = std::floor(min_disparity) - 2;
  result.disparities = 16 * static_cast<int>(std::ceil((max_disparity + 3 - first) / 16));
  // Semi-global matching leaves out the first `disparities` columns of the left image: add as many.
  const double border = 12;
  result.left.origin_px = Eigen::Vector2d(std::floor(low.x()) - border - result.disparities,
                                          std::floor(low.y()) - border);
  result.right.origin_px = result.left.origin_px - Eigen::Vector2d(first, 0);
  const Eigen::Vector2d size = high + Eigen::Vector2d::Constant(border) - result.left.origin_px;
  result.width = static_cast<int>(std::ceil(size.x()));
  result.height = static_cast<int>(std::ceil(size.y()));
  FillMaps(result, result.left);
  FillMaps(result, result.right);
  return result;
}

}  // namespace sole::recon
