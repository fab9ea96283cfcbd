#include "sim/posing.h"

#include <algorithm>

#include "sim/foot_kinematics.h"
#include "sim/skin_binding.h"
#include "sim/subject_shape.h"

namespace sole::sim {
namespace {

/// Height of the lowest point of a primitive over the plane through `origin` with unit normal `up`.
double Lowest(const FleshPrimitive& p, const Eigen::Vector3d& origin, const Eigen::Vector3d& up) {
  const double a = up.dot(p.a - origin);
  if (p.is_cone) return std::min(a - p.radius_a, up.dot(p.b - origin) - p.radius_b);
  return a - (p.half_axes.transpose() * up).norm();
}

void BendToe(int toe, double angle, std::map<std::string, double>& angles) {
  const std::string number = "_" + std::to_string(toe);
  angles["mtp" + number + ".dorsiflexion"] = angle;
  if (toe > 1) angles["pip" + number + ".dorsiflexion"] = 0.5 * angle;
}

PosedFoot Posed(const Subject& subject, const FootPose& pose, bool settled) {
  const SubjectShape& shape = *subject.shape;
  std::vector<Rigid3> motions = BoneMotions(shape.table, pose.angles_rad);
  const auto fixed = static_cast<std::size_t>(BoneIndex(shape.table, pose.fixed_bone));
  const Rigid3 hold = motions[fixed].Inverse();
  for (Rigid3& motion : motions) motion = hold * motion;

  PosedFoot posed;
  posed.vertices_m = CarriedByBones(shape.rest, Binding().shares, motions);
  if (settled) SettleOnSkin(ImplicitFoot(MovedTable(shape.table, motions)), posed.vertices_m);
  const bool left = subject.side == Side::kLeft;
  for (Eigen::Vector3d& v : posed.vertices_m) v = pose.world_from_foot * (left ? Mirrored(v) : v);
  for (const Rigid3& motion : motions) {
    posed.world_from_rest.push_back(pose.world_from_foot * (left ? Mirrored(motion) : motion));
  }
  return posed;
}

}  // namespace

PosedFoot PoseFoot(const Subject& subject, const FootPose& pose) { return Posed(subject, pose, true); }

PosedFoot CarryFoot(const Subject& subject, const FootPose& pose) { return Posed(subject, pose, false); }

Rigid3 StandingPlacement(const Subject& subject) {
  double tip = 0;
  for (const Eigen::Vector3d& v : subject.shape->rest) {
    if (v.z() < 0.06) tip = std::max(tip, v.y());
  }
  Rigid3 world_from_foot;
  world_from_foot.translation = {0, -0.5 * tip, 0};
  return world_from_foot;
}

void LowerToes(const Subject& subject, const Rigid3& foot_from_world, double sink_m, FootPose& pose) {
  const AnatomyTable& table = subject.shape->table;
  Eigen::Vector3d origin = foot_from_world.translation, up = foot_from_world.rotation * Eigen::Vector3d::UnitZ();
  if (subject.side == Side::kLeft) {
    origin = Mirrored(origin);
    up = Mirrored(up);
  }
  const auto fixed = static_cast<std::size_t>(BoneIndex(table, pose.fixed_bone));
  const auto lowest_of = [&](int toe, const std::map<std::string, double>& angles) {
    std::vector<Rigid3> motions = BoneMotions(table, angles);
    const Rigid3 hold = motions[fixed].Inverse();
    for (Rigid3& motion : motions) motion = hold * motion;
    const AnatomyTable moved = MovedTable(table, motions);
    double lowest = 1;
    for (const FleshPrimitive& p : moved.primitives) {
      if (p.group == toe) lowest = std::min(lowest, Lowest(p, origin, up));
    }
    return lowest;
  };
  for (int toe = 1; toe <= 5; ++toe) {
    double down = -0.5, high = 1.05;
    for (int i = 0; i < 15; ++i) {
      const double middle = 0.5 * (down + high);
      std::map<std::string, double> angles = pose.angles_rad;
      BendToe(toe, middle, angles);
      (lowest_of(toe, angles) < -sink_m ? down : high) = middle;
    }
    BendToe(toe, 0.5 * (down + high), pose.angles_rad);
  }
}

FootPose StandingPose(const Subject& subject) {
  FootPose pose;
  pose.world_from_foot = StandingPlacement(subject);
  LowerToes(subject, pose.world_from_foot.Inverse(), 0.0008, pose);
  return pose;
}

}  // namespace sole::sim
