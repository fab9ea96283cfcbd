#include "calib/judge.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

namespace sole::calib {
namespace {

struct Seen {
  std::size_t camera;
  Eigen::Vector2d pixel;
  double sigma_px = 0;
};

/// Standard deviation of the worst direction of a point that these views triangulate, metres.
double SigmaOf(const Rig& rig, const std::vector<Seen>& views, const Eigen::Vector3d& point) {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (const Seen& view : views) {
    const Camera& camera = rig.cameras[view.camera];
    const Eigen::Vector3d ray = point - camera.CentreInWorld(), along = ray.normalized();
    const double sigma_m = view.sigma_px * ray.norm() / camera.intrinsics[0];
    information += (Eigen::Matrix3d::Identity() - along * along.transpose()) / (sigma_m * sigma_m);
  }
  return 1 / std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information).eigenvalues()[0]);
}

/// Point from two or more views; not finite if they do not suffice or disagree by more than
/// `reject_px`.
Eigen::Vector3d Triangulate(const Rig& rig, const std::vector<Seen>& views, double reject_px) {
  std::vector<Ray> rays;
  for (const Seen& view : views)
    rays.push_back(RayFromPixel(rig.cameras[view.camera], rig.plate, view.pixel));
  const Eigen::Vector3d point = NearestPoint(rays);
  for (const Seen& view : views) {
    const double miss =
        (PixelFromWorld(rig.cameras[view.camera], rig.plate, point) - view.pixel).norm();
    if (!(miss <= reject_px))
      return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  return point;
}

struct ErrorSum {
  double squares = 0;
  LengthErrors errors;
  void Add(double error_m) {
    squares += error_m * error_m;
    errors.max_mm = std::max(errors.max_mm, 1000 * std::abs(error_m));
    ++errors.lengths;
  }
  LengthErrors Result() {
    if (errors.lengths > 0) errors.rms_mm = 1000 * std::sqrt(squares / errors.lengths);
    return errors;
  }
};

}  // namespace

Eigen::Vector3d NearestPoint(std::span<const Ray> rays) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Ray& ray : rays) {
    const Eigen::Matrix3d across =
        Eigen::Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    normal += across;
    right += across * ray.origin;
  }
  const double smallest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(normal).eigenvalues()[0];
  if (rays.size() < 2 || smallest < 1e-9) {
    return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
  }
  return normal.ldlt().solve(right);
}

namespace {

/// A corner as it was measured, and where it is in the body.
struct Corner {
  Eigen::Vector3d world, body;
  double sigma_m = 0;
};

std::vector<Corner> CornersSeenFrom(const Rig& rig, bool below,
                                    const std::vector<ViewObservations>& frame,
                                    const std::vector<Eigen::Vector3d>& target_corners,
                                    double reject_px, int& points, int& rejected) {
  std::map<int, std::vector<Seen>> seen;
  for (std::size_t c = 0; c < frame.size(); ++c) {
    if (LooksThroughPlate(rig.cameras[c], rig.plate) != below) continue;
    for (const PointObservation& o : frame[c].target) seen[o.point].push_back({c, o.pixel, o.sigma_px});
  }
  std::vector<Corner> corners;
  for (const auto& [corner, views] : seen) {
    if (views.size() < 2) continue;
    ++points;
    const Eigen::Vector3d point = Triangulate(rig, views, reject_px);
    if (point.allFinite()) {
      corners.push_back({point, target_corners[static_cast<std::size_t>(corner)],
                         SigmaOf(rig, views, point)});
    } else {
      ++rejected;
    }
  }
  return corners;
}

double LengthError(const Corner& a, const Corner& b) {
  return (a.world - b.world).norm() - (a.body - b.body).norm();
}

void AddLengths(const std::vector<Corner>& corners, ErrorSum& sum) {
  for (std::size_t i = 0; i < corners.size(); ++i) {
    for (std::size_t j = i + 1; j < corners.size(); ++j) sum.Add(LengthError(corners[i], corners[j]));
  }
}

using SidesOfFrame = std::array<std::vector<Corner>, 2>;  ///< seen from above and from below

/// Deviation beyond which a corner of one side does not judge (kJudgeSigma_m).
double JudgeLimit(const std::vector<SidesOfFrame>& frames, std::size_t side) {
  std::vector<double> sigmas;
  for (const SidesOfFrame& frame : frames) {
    for (const Corner& corner : frame[side]) sigmas.push_back(corner.sigma_m);
  }
  if (sigmas.empty()) return kJudgeSigma_m;
  const auto middle = sigmas.begin() + static_cast<std::ptrdiff_t>(sigmas.size() / 2);
  std::nth_element(sigmas.begin(), middle, sigmas.end());
  return std::max(kJudgeSigma_m, kJudgeSigmas * *middle);
}

}  // namespace

TargetErrors JudgeTarget(const Rig& rig, const TakeObservations& heldout,
                         const std::vector<Eigen::Vector3d>& target_corners, double reject_px) {
  ErrorSum air, glass, across;
  int points = 0;
  std::vector<SidesOfFrame> corners;
  for (const auto& frame : heldout.frames) {
    corners.push_back({CornersSeenFrom(rig, false, frame, target_corners, reject_px, points,
                                       air.errors.rejected),
                       CornersSeenFrom(rig, true, frame, target_corners, reject_px, points,
                                       glass.errors.rejected)});
  }
  for (const std::size_t side : {0u, 1u}) {
    const double limit = JudgeLimit(corners, side);
    for (auto& frame : corners)
      std::erase_if(frame[side], [limit](const Corner& corner) { return corner.sigma_m > limit; });
  }
  for (const auto& [above, below] : corners) {
    AddLengths(above, air);
    AddLengths(below, glass);
    for (const Corner& a : above) {
      for (const Corner& b : below) across.Add(LengthError(a, b));
    }
  }
  return {air.Result(), glass.Result(), across.Result(), points};
}

namespace {

/// Corners of one frame that `use` says a camera may show, triangulated from two or more views.
template <typename Use>
std::map<int, std::vector<Seen>> ViewsOf(const std::vector<ViewObservations>& frame, const Use& use) {
  std::map<int, std::vector<Seen>> views;
  for (std::size_t c = 0; c < frame.size(); ++c) {
    if (!use(static_cast<int>(c))) continue;
    for (const PointObservation& o : frame[c].target) views[o.point].push_back({c, o.pixel});
  }
  std::erase_if(views, [](const auto& entry) { return entry.second.size() < 2; });
  return views;
}

/// Pose of the body from corners triangulated by all cameras; empty for fewer than four.
std::optional<Rigid3> BodyPose(const Rig& rig, const std::vector<ViewObservations>& frame,
                               const std::vector<Eigen::Vector3d>& target_corners,
                               double reject_px) {
  std::vector<Corner> found;
  for (const auto& [corner, views] : ViewsOf(frame, [](int) { return true; })) {
    const Eigen::Vector3d point = Triangulate(rig, views, reject_px);
    if (point.allFinite()) found.push_back({point, target_corners[static_cast<std::size_t>(corner)]});
  }
  if (found.size() < 4) return {};
  Eigen::Matrix3Xd body(3, found.size()), world(3, found.size());
  for (std::size_t i = 0; i < found.size(); ++i) {
    body.col(static_cast<Eigen::Index>(i)) = found[i].body;
    world.col(static_cast<Eigen::Index>(i)) = found[i].world;
  }
  const Eigen::Matrix4d pose = Eigen::umeyama(body, world, false);
  return Rigid3{Eigen::Quaterniond(pose.topLeftCorner<3, 3>()), pose.topRightCorner<3, 1>()};
}

/// Of each component.
Eigen::Vector3d Median(std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d median;
  const auto middle = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2);
  for (int axis = 0; axis < 3; ++axis) {
    std::nth_element(points.begin(), middle, points.end(),
                     [axis](const auto& a, const auto& b) { return a[axis] < b[axis]; });
    median[axis] = (*middle)[axis];
  }
  return median;
}

constexpr double kNotJudged = std::numeric_limits<double>::quiet_NaN();

}  // namespace

std::vector<PairErrors> JudgePairs(const Rig& rig, const TakeObservations& heldout,
                                   const std::vector<Eigen::Vector3d>& target_corners,
                                   double reject_px) {
  constexpr int kLeastCorners = 4;
  std::vector<PairErrors> errors;
  for (const StereoPair& pair : rig.pairs) {
    double offsets = 0, misses = 0;
    int poses = 0, points = 0;
    for (const auto& frame : heldout.frames) {
      const auto views =
          ViewsOf(frame, [&](int c) { return c == pair.left || c == pair.right; });
      if (static_cast<int>(views.size()) < kLeastCorners) continue;
      const std::optional<Rigid3> pose = BodyPose(rig, frame, target_corners, reject_px);
      if (!pose) continue;
      std::vector<Eigen::Vector3d> displaced;
      for (const auto& [corner, seen] : views) {
        const Eigen::Vector3d point = Triangulate(rig, seen, 10 * reject_px);
        if (!point.allFinite()) continue;
        double miss = 0;  // half of the distance in either image
        for (const Seen& view : seen) {
          miss += (PixelFromWorld(rig.cameras[view.camera], rig.plate, point) - view.pixel).norm();
        }
        misses += miss * miss;
        ++points;
        displaced.push_back(point - *pose * target_corners[static_cast<std::size_t>(corner)]);
      }
      if (static_cast<int>(displaced.size()) < kLeastCorners) continue;
      offsets += Median(displaced).squaredNorm();
      ++poses;
    }
    errors.push_back({poses > 0 ? 1000 * std::sqrt(offsets / poses) : kNotJudged,
                      points > 0 ? std::sqrt(misses / points) : kNotJudged});
  }
  return errors;
}

LengthErrors JudgeGround(const Rig& rig, const TakeObservations& take, double reject_px) {
  std::map<int, std::map<std::size_t, std::pair<Eigen::Vector2d, int>>> sums;
  for (const auto& frame : take.frames) {
    for (std::size_t c = 0; c < frame.size(); ++c) {
      for (const PointObservation& o : frame[c].fiducials) {
        auto& entry = sums[o.point].try_emplace(c, Eigen::Vector2d::Zero(), 0).first->second;
        entry.first += o.pixel;
        ++entry.second;
      }
    }
  }
  ErrorSum sum;
  std::map<int, std::pair<double, int>> heights;  // of each fiducial: sum, corners
  for (const auto& [point, cameras] : sums) {
    if (cameras.size() < 2) continue;
    std::vector<Seen> views;
    for (const auto& [camera, entry] : cameras)
      views.push_back({camera, entry.first / entry.second});
    const Eigen::Vector3d world = Triangulate(rig, views, reject_px);
    if (world.allFinite()) {
      auto& height = heights[point / 4];
      height.first += world.z();
      ++height.second;
    } else {
      ++sum.errors.rejected;
    }
  }
  for (const auto& [fiducial, height] : heights) sum.Add(height.first / height.second);
  return sum.Result();
}

}  // namespace sole::calib
