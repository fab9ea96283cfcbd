#include "calib/agreement.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/error.h"

namespace sole::calib {
namespace {

const Camera& CameraOf(const Rig& rig, const std::string& serial) {
  const auto found = std::find_if(rig.cameras.begin(), rig.cameras.end(),
                                  [&](const Camera& camera) { return camera.serial == serial; });
  Require(found != rig.cameras.end(), "COLMAP: camera " + serial + " is not in the calibration");
  return *found;
}

/// A camera's frame as four points, its centre and the tips of axes of this length: with them, two
/// cameras alone suffice to lay a rig onto another.
constexpr double kAxis_m = 0.1;
Eigen::Matrix<double, 3, 4> FrameOf(const Camera& camera) {
  const Rigid3 world_from_cam = camera.cam_from_world.Inverse();
  Eigen::Matrix<double, 3, 4> points;
  points << Eigen::Vector3d::Zero(), kAxis_m * Eigen::Matrix3d::Identity();
  for (int i = 0; i < 4; ++i) points.col(i) = world_from_cam * Eigen::Vector3d(points.col(i));
  return points;
}

using Frames = std::vector<Eigen::Matrix<double, 3, 4>>;

Rigid3 FitFrames(const Frames& from, const Frames& to) {
  const auto n = static_cast<Eigen::Index>(4 * from.size());
  const Eigen::Map<const Eigen::Matrix3Xd> a(from.front().data(), 3, n), b(to.front().data(), 3, n);
  const Eigen::Matrix4d m = Eigen::umeyama(a, b, false);
  return {Eigen::Quaterniond(Eigen::Matrix3d(m.topLeftCorner<3, 3>())), m.topRightCorner<3, 1>()};
}

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// How far apart the two cameras see the corners, and what a small motion of COLMAP's rig changes.
struct ViewDifference {
  double rms_px = 0;
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
};
ViewDifference DifferenceOf(const Camera& our, const Camera& theirs, const std::vector<Eigen::Vector3d>& points,
                            const Rigid3& ours_from_colmap) {
  ViewDifference d;
  const Eigen::Matrix3d rotation = our.cam_from_world.rotation.toRotationMatrix();
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d moved = ours_from_colmap * point, in_cam = our.cam_from_world * moved;
    const Eigen::Vector2d difference =
        PixelFromPointInCam<double>(our.intrinsics.data(), in_cam) -
        PixelFromPointInCam<double>(theirs.intrinsics.data(), Eigen::Vector3d(theirs.cam_from_world * point));
    Eigen::Matrix<double, 3, 6> motion;
    motion << -rotation * Cross(moved), rotation;
    const Eigen::Matrix<double, 2, 6> jacobian = PixelJacobianAt(our.intrinsics.data(), in_cam).point_in_cam * motion;
    d.normal += jacobian.transpose() * jacobian;
    d.gradient += jacobian.transpose() * difference;
    d.rms_px += difference.squaredNorm();
  }
  const double count = std::max(1.0, static_cast<double>(points.size()));
  d.rms_px = std::sqrt(d.rms_px / count);
  d.normal /= count;
  d.gradient /= count;
  return d;
}

/// Moves COLMAP's rig until the cameras see the target alike (Gauss-Newton; each camera counts by
/// Geman-McClure's weight of its difference, whose scale is twice the median of all, 0.05 px at least).
Rigid3 AlignViews(const std::vector<Camera>& ours, const ColmapRig& colmap, Rigid3 fit, std::vector<double>& weights) {
  for (int iteration = 0; iteration < 30; ++iteration) {
    std::vector<ViewDifference> views;
    std::vector<double> sorted;
    for (std::size_t c = 0; c < ours.size(); ++c) {
      views.push_back(DifferenceOf(ours[c], colmap.cameras[c], colmap.seen_m[c], fit));
      sorted.push_back(views.back().rms_px);
    }
    std::sort(sorted.begin(), sorted.end());
    const double scale = std::max(2 * sorted[(sorted.size() - 1) / 2], 0.05);
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
    for (std::size_t c = 0; c < ours.size(); ++c) {
      weights[c] = std::pow(1 + std::pow(views[c].rms_px / scale, 2), -2);
      normal += weights[c] * views[c].normal;
      gradient += weights[c] * views[c].gradient;
    }
    const Eigen::Matrix<double, 6, 1> step = normal.ldlt().solve(-gradient);
    const Eigen::Vector3d turn = step.head<3>();
    Rigid3 motion;
    if (turn.norm() > 0) motion.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    motion.translation = step.tail<3>();
    fit = motion * fit;
  }
  return fit;
}

/// Growth of `from` that makes its centres lie as far apart as those of `to`.
double ScaleOf(const Frames& from, const Frames& to, const Rigid3& fit, const std::vector<double>& weights) {
  Eigen::Vector3d from_mean = Eigen::Vector3d::Zero(), to_mean = Eigen::Vector3d::Zero();
  double sum = 0, product = 0, squares = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    from_mean += weights[i] * from[i].col(0);
    to_mean += weights[i] * to[i].col(0);
    sum += weights[i];
  }
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d a = fit.rotation * (from[i].col(0) - from_mean / sum);
    product += weights[i] * a.dot(to[i].col(0) - to_mean / sum);
    squares += weights[i] * a.squaredNorm();
  }
  return product / squares;
}

}  // namespace

Agreement CompareWithColmap(const Rig& ours, const ColmapRig& colmap, const AgreementLimits& limits) {
  Frames from, to;
  std::vector<Camera> our_cameras;
  for (const Camera& camera : colmap.cameras) {
    our_cameras.push_back(CameraOf(ours, camera.serial));
    from.push_back(FrameOf(camera));
    to.push_back(FrameOf(our_cameras.back()));
  }
  std::vector<double> weights(from.size(), 1);
  const Rigid3 ours_from_colmap = AlignViews(our_cameras, colmap, FitFrames(from, to), weights);
  Agreement agreement;
  agreement.scale = ScaleOf(from, to, ours_from_colmap, weights);
  double centres = 0, directions = 0, views = 0;
  for (std::size_t c = 0; c < colmap.cameras.size(); ++c) {
    const Camera &theirs = colmap.cameras[c], &our = our_cameras[c];
    CameraAgreement a{.serial = theirs.serial};
    a.centre_mm = 1000 * (ours_from_colmap * theirs.CentreInWorld() - our.CentreInWorld()).norm();
    const Eigen::Vector3d axis = theirs.cam_from_world.Inverse().rotation * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d in_our = our.cam_from_world.rotation * (ours_from_colmap.rotation * axis);
    a.direction_deg = std::atan2(in_our.head<2>().norm(), in_our.z()) * 180 / M_PI;
    a.focal_px = 0.5 * (theirs.intrinsics.head<2>() - our.intrinsics.head<2>()).sum();
    a.view_px = DifferenceOf(our, theirs, colmap.seen_m[c], ours_from_colmap).rms_px;
    a.agrees = a.view_px <= limits.view_px;
    agreement.cameras.push_back(a);
    centres += a.centre_mm * a.centre_mm;
    directions += a.direction_deg * a.direction_deg;
    views += a.view_px * a.view_px;
  }
  const double count = static_cast<double>(std::max<std::size_t>(1, agreement.cameras.size()));
  agreement.centre_rms_mm = std::sqrt(centres / count);
  agreement.direction_rms_deg = std::sqrt(directions / count);
  agreement.view_rms_px = std::sqrt(views / count);
  return agreement;
}

}  // namespace sole::calib
