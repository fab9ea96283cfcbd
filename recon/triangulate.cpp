#include "recon/triangulate.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace sole::recon {
namespace {

// Beside the plate a raised foot turns toes and shank away from the lamps: what is dim or lit at a
// grazing angle is uncertain by more than a sole above the lamps below it.
constexpr double kAirSpread = 1.4;

struct Candidate {
  PairPoint point;
  double gap_px = 0;
  double angle_rad = 0;
};

/// Distance of b's ray from a's, positive along a x b.
double SignedGap(const Ray& a, const Ray& b) {
  const Eigen::Vector3d across = a.direction.cross(b.direction);
  return (b.origin - a.origin).dot(across) / across.norm();
}

/// Depth of the crossing along `left`, and the derivative by the right pixel.
Candidate TriangulateOne(const Camera& left, const Camera& right, const Plate& plate,
                         const PixelMatch& match, double floor_px) {
  Candidate result;
  const Eigen::Vector2d right_px = match.match.warp.position_px;
  const Ray a = RayFromPixel(left, plate, match.left_px.cast<double>());
  const Ray b = RayFromPixel(right, plate, right_px);
  const Eigen::Vector3d point = IntersectRays(a, b).point;
  const double depth = a.direction.dot(point - a.origin);
  constexpr double kStep = 0.25;
  Eigen::Vector2d slope;
  for (int axis = 0; axis < 2; ++axis) {
    const Ray moved = RayFromPixel(right, plate, right_px + kStep * Eigen::Vector2d::Unit(axis));
    slope[axis] = (a.direction.dot(IntersectRays(a, moved).point - a.origin) - depth) / kStep;
  }
  const Eigen::Matrix2d covariance =
      match.match.covariance_px2 + floor_px * floor_px * Eigen::Matrix2d::Identity();
  result.point.point_m = point;
  result.point.to_camera = -a.direction;
  result.point.ray_sigma_m = std::sqrt(slope.dot(covariance * slope));
  result.gap_px = SignedGap(a, b) / depth * left.intrinsics[0];
  result.angle_rad = std::acos(std::clamp(a.direction.dot(b.direction), -1.0, 1.0));
  return result;
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

bool InVolume(const Eigen::Vector3d& p, bool glass, const TriangulateOptions& options) {
  const CaptureVolume& v = options.volume;
  const double top = glass ? v.max_height_through_glass_m : v.max_m.z();
  return p.x() >= v.min_m.x() && p.x() <= v.max_m.x() && p.y() >= v.min_m.y() &&
         p.y() <= v.max_m.y() && p.z() >= -options.max_depth_below_glass_m && p.z() <= top;
}

}  // namespace

Triangulation Triangulate(const Rig& rig, int pair, std::span<const PixelMatch> matches,
                          const ImageU8& left, const TriangulateOptions& options) {
  Require(pair >= 0 && pair < static_cast<int>(rig.pairs.size()), "no such pair in the rig");
  const StereoPair& names = rig.pairs[static_cast<std::size_t>(pair)];
  const Camera& camera_left = rig.cameras[static_cast<std::size_t>(names.left)];
  const Camera& camera_right = rig.cameras[static_cast<std::size_t>(names.right)];
  const bool glass =
      LooksThroughPlate(camera_left, rig.plate) || LooksThroughPlate(camera_right, rig.plate);

  std::vector<Candidate> candidates(matches.size());
  tbb::parallel_for(std::size_t{0}, matches.size(), [&](std::size_t i) {
    candidates[i] =
        TriangulateOne(camera_left, camera_right, rig.plate, matches[i], options.floor_px);
  });
  std::vector<double> gaps;
  for (const Candidate& c : candidates) {
    if (std::isfinite(c.gap_px)) gaps.push_back(c.gap_px);
  }
  std::vector<double> sigmas;
  for (const Candidate& c : candidates) {
    if (std::isfinite(c.point.ray_sigma_m)) sigmas.push_back(c.point.ray_sigma_m);
  }
  const double ratio = options.max_sigma_ratio * (glass ? 1 : kAirSpread);
  const double max_sigma_m = std::min(options.max_sigma_m, ratio * Median(std::move(sigmas)));
  Triangulation result;
  result.median_gap_px = Median(gaps);
  for (double& gap : gaps) gap = std::abs(gap - result.median_gap_px);
  const double window = std::max(options.min_gap_window_px,
                                 options.max_gap_spread * 1.4826 * Median(std::move(gaps)));
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    Candidate& c = candidates[i];
    if (!(std::abs(c.gap_px) < options.max_gap_px) ||
        !(std::abs(c.gap_px - result.median_gap_px) < window)) {
      ++result.bad_gap;
    } else if (!c.point.point_m.allFinite() || !InVolume(c.point.point_m, glass, options)) {
      ++result.outside;
    } else if (!(c.point.ray_sigma_m <= max_sigma_m) ||
               c.angle_rad < options.min_angle_rad) {
      ++result.uncertain;
    } else {
      c.point.intensity =
          static_cast<float>(left.At(matches[i].left_px.x(), matches[i].left_px.y()));
      c.point.pair = static_cast<std::uint8_t>(pair);
      result.points.push_back(c.point);
    }
  }
  return result;
}

}  // namespace sole::recon
