#include "sim/foot_shape.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include <Eigen/Geometry>
#include <Eigen/SVD>

#include "sim/foot_kinematics.h"
#include "sim/skin_binding.h"

namespace sole::sim {
namespace {

double Step(double x, double from, double to) {
  const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

bool OfSecondToe(const std::string& bone) { return bone.ends_with("phalanx_2"); }

/// Central-difference Jacobian of the warp.
Eigen::Matrix3d WarpJacobian(const ShapeHandles& handles, const Eigen::Vector3d& point, double second_toe) {
  constexpr double kStep = 1e-5;
  Eigen::Matrix3d jacobian;
  for (int j = 0; j < 3; ++j) {
    const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(j);
    jacobian.col(j) = (WarpedPoint(handles, point + step, second_toe) -
                       WarpedPoint(handles, point - step, second_toe)) / (2 * kStep);
  }
  return jacobian;
}

std::map<std::string, double> ToeAngles(const ShapeHandles& h) {
  return {{"mtp_1.abduction", 0.5 * h.toe_fan_rad - h.hallux_valgus_rad},
          {"mtp_2.abduction", -0.3 * h.toe_fan_rad - 0.15 * std::max(h.hallux_valgus_rad, 0.0)},
          {"mtp_3.abduction", -0.7 * h.toe_fan_rad},
          {"mtp_4.abduction", -1.1 * h.toe_fan_rad},
          {"mtp_5.abduction", -1.5 * h.toe_fan_rad}};
}

void WarpPrimitive(const ShapeHandles& handles, double second_toe, FleshPrimitive& p) {
  const Eigen::Matrix3d at_a = WarpJacobian(handles, p.a, second_toe);
  if (p.is_cone) {
    const Eigen::Vector3d direction = (p.b - p.a).normalized();
    const Eigen::Matrix3d at_b = WarpJacobian(handles, p.b, second_toe);
    p.radius_a *= std::sqrt(std::abs(at_a.determinant()) / (at_a * direction).norm());
    p.radius_b *= std::sqrt(std::abs(at_b.determinant()) / (at_b * direction).norm());
    p.b = WarpedPoint(handles, p.b, second_toe);
  } else {
    const Eigen::JacobiSVD<Eigen::Matrix3d> svd(at_a * p.half_axes, Eigen::ComputeFullU);
    p.half_axes = svd.matrixU() * svd.singularValues().asDiagonal();
  }
  p.a = WarpedPoint(handles, p.a, second_toe);
  p.k *= 1 + handles.scale;
}

}  // namespace

Eigen::Vector3d WarpedPoint(const ShapeHandles& h, const Eigen::Vector3d& point, double second_toe) {
  Eigen::Vector3d p = 1e3 * point;
  double &x = p.x(), &y = p.y(), &z = p.z();
  y += second_toe * h.second_toe_length * std::max(y - 196, 0.0);
  y += h.ball_length_mm * Step(y, 60, 175) * (1 - Step(y, 200, 262));
  x = -3 + (x + 3) * (1 + h.foot_breadth * Step(y, 95, 165));
  z *= 1 + h.ball_height * Step(y, 120, 170) * (1 - Step(y, 205, 235));
  x *= 1 + h.heel_breadth * (1 - Step(y, 60, 115)) * (1 - Step(z, 38, 70));
  const double front = 0.6 * (y - 60) + 0.8 * (z - 46);
  const double w = Step(front, 10, 50) * Step(y, 60, 95) * (1 - Step(y, 130, 185)) * (1 - Step(z, 95, 130));
  y += 0.6 * h.ankle_front_mm * w;
  z += 0.8 * h.ankle_front_mm * w;
  x = -3 + (x + 3) * (1 + h.malleoli_breadth * Step(z, 54, 74) * (1 - Step(z, 95, 125)) * (1 - Step(y, 85, 120)) *
                              Step(y, 15, 35));
  const double shank = h.shank_girth * Step(z, 84, 118);
  x = -1 + (x + 1) * (1 + shank);
  y = 45 + (y - 45) * (1 + shank);
  z += h.arch_height_mm * Step(y, 52, 95) * (1 - Step(y, 120, 165)) * (1 - Step(x, -8, 28)) * (1 - Step(z, 34, 66));
  const double t = std::max(z - 15, 0.0);
  z += h.ankle_height * (t < 30 ? t * t / 60 : t - 15) * (1 - 0.6 * Step(z, 90, 160));
  return 1e-3 * (1 + h.scale) * p;
}

AnatomyTable ShapedTable(const AnatomyTable& mean, const ShapeHandles& handles) {
  AnatomyTable table = mean;
  const auto second = [&](int a, int b) {
    return OfSecondToe(mean.bones[static_cast<std::size_t>(a)].name) &&
                   OfSecondToe(mean.bones[static_cast<std::size_t>(b)].name) ? 1.0 : 0.0;
  };
  for (std::size_t i = 0; i < table.bones.size(); ++i) {
    AnatomyBone& bone = table.bones[i];
    const double toe = OfSecondToe(bone.name) ? 1 : 0;
    for (AnatomyAxis& axis : bone.axes) {
      axis.axis = (WarpJacobian(handles, bone.joint_centre, toe) * axis.axis).normalized();
    }
    bone.proximal = WarpedPoint(handles, bone.proximal, toe);
    bone.distal = WarpedPoint(handles, bone.distal, toe);
    bone.joint_centre = WarpedPoint(handles, bone.joint_centre, toe);
  }
  for (FleshPrimitive& p : table.primitives) WarpPrimitive(handles, second(p.bone_a, p.bone_b), p);
  for (Nail& nail : table.nails) {
    const double toe = nail.toe == 2 ? 1 : 0;
    nail.half_width *= (WarpJacobian(handles, nail.centre, toe) * nail.axes.col(0)).norm();
    nail.half_length *= (WarpJacobian(handles, nail.centre, toe) * nail.axes.col(1)).norm();
    nail.centre = WarpedPoint(handles, nail.centre, toe);
  }
  table.k_body_toes *= 1 + handles.scale;
  table.cut_point = WarpedPoint(handles, table.cut_point, 0);
  return MovedTable(table, BoneMotions(table, ToeAngles(handles)));
}

std::vector<Eigen::Vector3d> ShapedPoints(const AnatomyTable& mean, const ShapeHandles& handles,
                                          const Eigen::MatrixXf& shares, const std::vector<Eigen::Vector3d>& points) {
  Eigen::VectorXf second = Eigen::VectorXf::Zero(shares.rows());
  for (std::size_t b = 0; b < mean.bones.size(); ++b) {
    if (OfSecondToe(mean.bones[b].name)) second += shares.col(static_cast<Eigen::Index>(b));
  }
  std::vector<Eigen::Vector3d> shaped(points.size());
  for (std::size_t v = 0; v < points.size(); ++v) {
    shaped[v] = WarpedPoint(handles, points[v], static_cast<double>(second[static_cast<Eigen::Index>(v)]));
  }
  ShapeHandles warps = handles;
  warps.hallux_valgus_rad = warps.toe_fan_rad = 0;
  const AnatomyTable warped = ShapedTable(mean, warps);
  return CarriedByBones(shaped, shares, BoneMotions(warped, ToeAngles(handles)));
}

}  // namespace sole::sim
