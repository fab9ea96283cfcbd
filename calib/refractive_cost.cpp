#include <cmath>

#include "calib/refractive_cost_internal.h"
#include "core/plate.h"

namespace sole::calib {
namespace {

Eigen::Matrix3d Cross(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

/// exp of a rotation vector and its left Jacobian: exp(w + dw) = exp(left dw) exp(w).
struct Turn {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d left = Eigen::Matrix3d::Identity();

  explicit Turn(const double* w) {
    const Eigen::Matrix3d x = Cross({w[0], w[1], w[2]});
    const Eigen::Matrix3d xx = x * x;
    const double angle2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
    double a = 1, b = 0.5, c = 1.0 / 6;  // sin(t)/t, (1 - cos t)/t^2, (t - sin t)/t^3
    if (angle2 > 1e-8) {
      const double angle = std::sqrt(angle2);
      a = std::sin(angle) / angle;
      b = (1 - std::cos(angle)) / angle2;
      c = (1 - a) / angle2;
    } else {
      a -= angle2 / 6;
      b -= angle2 / 24;
    }
    rotation += a * x + b * xx;
    left += b * x + c * xx;
  }
};

template <typename Values>
void Store(double* to, const Values& jacobian, double scale) {
  if (!to) return;
  Eigen::Map<Eigen::Matrix<double, 2, Values::ColsAtCompileTime,
                           Values::ColsAtCompileTime == 1 ? Eigen::ColMajor : Eigen::RowMajor>>
      values(to);
  values = jacobian * scale;
}

}  // namespace

Rigid3 Moved(const Rigid3& reference, const double* d) {
  Rigid3 moved = reference;
  moved.rotation = (Eigen::Quaterniond(Turn(d).rotation) * reference.rotation).normalized();
  moved.translation += Eigen::Vector3d(d[3], d[4], d[5]);
  return moved;
}

bool RefractedResidual::Evaluate(const double* camera, const double* intrinsics, double thickness,
                                 const Eigen::Vector3d& point_in_world, double* residual,
                                 Jacobian* jacobian) const {
  const Turn turn(camera);
  const Eigen::Matrix3d rotation = turn.rotation * cam_from_world.rotation.toRotationMatrix();
  const Eigen::Vector3d translation =
      cam_from_world.translation + Eigen::Vector3d(camera[3], camera[4], camera[5]);
  const Eigen::Vector3d centre = -(rotation.transpose() * translation);
  ApparentPointJacobian by;
  const Eigen::Vector3d rotated =
      rotation * ApparentPoint({thickness, index}, centre, point_in_world, jacobian ? &by : nullptr);
  const Eigen::Vector3d in_cam = rotated + translation;
  if (!(in_cam.z() > 1e-3)) return false;
  const Eigen::Vector2d projected = PixelFromPointInCam<double>(intrinsics, in_cam);
  residual[0] = (projected.x() - pixel.x()) / sigma_px;
  residual[1] = (projected.y() - pixel.y()) / sigma_px;
  if (!jacobian) return true;

  PixelJacobian pixel_by = PixelJacobianAt(intrinsics, in_cam);
  const Eigen::Matrix<double, 2, 3>& by_cam = pixel_by.point_in_cam;
  // The apparent point's x and y; its z is that of the point.
  const Eigen::Matrix<double, 2, 3> by_world = by_cam * rotation;
  const Eigen::Matrix2d by_apparent = by_world.leftCols<2>();
  jacobian->point_in_world = by_apparent * by.point;
  jacobian->point_in_world.col(2) += by_world.col(2);
  jacobian->thickness = by_apparent * by.thickness_m;
  // A small turn d on the left moves the rotated point by d x rotated and the centre by
  // R^T (d x t); a shift s of the translation moves the centre by -R^T s.
  const Eigen::Matrix<double, 2, 3> by_centre = by_apparent * by.centre * rotation.transpose();
  jacobian->camera << (-by_cam * Cross(rotated) - by_centre * Cross(translation)) * turn.left,
      by_cam - by_centre;
  jacobian->intrinsics = pixel_by.intrinsics;
  return true;
}

TargetCost::TargetCost(const RefractedResidual& projection, const Rigid3& world_from_body,
                       const Eigen::Vector3d& point_in_body)
    : projection_(projection), world_from_body_(world_from_body), point_in_body_(point_in_body) {}

bool TargetCost::Evaluate(double const* const* blocks, double* residual,
                          double** jacobians) const {
  const double* pose = blocks[2];
  const Turn turn(pose);
  const Eigen::Vector3d rotated = turn.rotation * (world_from_body_.rotation * point_in_body_);
  const Eigen::Vector3d point =
      rotated + world_from_body_.translation + Eigen::Vector3d(pose[3], pose[4], pose[5]);
  RefractedResidual::Jacobian by;
  if (!projection_.Evaluate(blocks[0], blocks[1], *blocks[3], point, residual,
                            jacobians ? &by : nullptr))
    return false;
  if (!jacobians) return true;
  const double scale = 1 / projection_.sigma_px;
  Eigen::Matrix<double, 2, kPoseSize> by_body;
  by_body << -by.point_in_world * Cross(rotated) * turn.left, by.point_in_world;
  Store(jacobians[0], by.camera, scale);
  Store(jacobians[1], by.intrinsics, scale);
  Store(jacobians[2], by_body, scale);
  Store(jacobians[3], by.thickness, scale);
  return true;
}

FiducialCost::FiducialCost(const RefractedResidual& projection,
                           const Eigen::Vector3d& point_in_world)
    : projection_(projection), point_in_world_(point_in_world) {}

bool FiducialCost::Evaluate(double const* const* blocks, double* residual,
                            double** jacobians) const {
  const Eigen::Vector3d point = point_in_world_ + Eigen::Vector3d(blocks[2][0], blocks[2][1], 0);
  RefractedResidual::Jacobian by;
  if (!projection_.Evaluate(blocks[0], blocks[1], *blocks[3], point, residual,
                            jacobians ? &by : nullptr))
    return false;
  if (!jacobians) return true;
  const double scale = 1 / projection_.sigma_px;
  Store(jacobians[0], by.camera, scale);
  Store(jacobians[1], by.intrinsics, scale);
  Store(jacobians[2], Eigen::Matrix2d(by.point_in_world.leftCols<2>()), scale);
  Store(jacobians[3], by.thickness, scale);
  return true;
}

}  // namespace sole::calib
