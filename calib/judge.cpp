#include "calib/judge.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

namespace sole::calib {
namespace {

struct Seen {
  std::size_t camera;
  Eigen::Vector2d pixel;
};

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

LengthErrors JudgeTarget(const Rig& rig, ViewSide side, const TakeObservations& heldout,
                         const std::vector<Eigen::Vector3d>& target_corners, double reject_px) {
  ErrorSum sum;
  for (const auto& frame : heldout.frames) {
    std::map<int, std::vector<Seen>> corners;
    for (std::size_t c = 0; c < frame.size(); ++c) {
      if (LooksThroughPlate(rig.cameras[c], rig.plate) != (side == ViewSide::kGlass)) continue;
      for (const PointObservation& o : frame[c].target) corners[o.point].push_back({c, o.pixel});
    }
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> found;  // measured, true in the body
    for (const auto& [corner, views] : corners) {
      if (views.size() < 2) continue;
      const Eigen::Vector3d point = Triangulate(rig, views, reject_px);
      if (point.allFinite()) {
        found.emplace_back(point, target_corners[static_cast<std::size_t>(corner)]);
      } else {
        ++sum.errors.rejected;
      }
    }
    for (std::size_t i = 0; i < found.size(); ++i) {
      for (std::size_t j = i + 1; j < found.size(); ++j) {
        sum.Add((found[i].first - found[j].first).norm() -
                (found[i].second - found[j].second).norm());
      }
    }
  }
  return sum.Result();
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
