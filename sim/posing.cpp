#include "sim/posing.h"

#include <algorithm>

#include "sim/foot_kinematics.h"
#include "sim/skin_binding.h"
#include "sim/subject_shape.h"

namespace sole::sim {
namespace {

/// Lowest point of a primitive.
double Lowest(const FleshPrimitive& p) {
  if (p.is_cone) return std::min(p.a.z() - p.radius_a, p.b.z() - p.radius_b);
  return p.a.z() - p.half_axes.row(2).norm();
}

double LowestOfToe(const AnatomyTable& table, int toe) {
  double lowest = 1;
  for (const FleshPrimitive& p : table.primitives) {
    if (p.group == toe) lowest = std::min(lowest, Lowest(p));
  }
  return lowest;
}

void BendToe(int toe, double angle, std::map<std::string, double>& angles) {
  const std::string number = "_" + std::to_string(toe);
  angles["mtp" + number + ".dorsiflexion"] = angle;
  if (toe > 1) angles["pip" + number + ".dorsiflexion"] = 0.5 * angle;
}

}  // namespace

PosedFoot PoseFoot(const Subject& subject, const FootPose& pose) {
  const SubjectShape& shape = *subject.shape;
  std::vector<Rigid3> motions = BoneMotions(shape.table, pose.angles_rad);
  const auto fixed = static_cast<std::size_t>(BoneIndex(shape.table, pose.fixed_bone));
  const Rigid3 hold = motions[fixed].Inverse();
  for (Rigid3& motion : motions) motion = hold * motion;

  PosedFoot posed;
  posed.vertices_m = CarriedByBones(shape.rest, Binding().shares, motions);
  SettleOnSkin(ImplicitFoot(MovedTable(shape.table, motions)), posed.vertices_m);
  const bool left = subject.side == Side::kLeft;
  for (Eigen::Vector3d& v : posed.vertices_m) v = pose.world_from_foot * (left ? Mirrored(v) : v);
  for (const Rigid3& motion : motions) {
    posed.world_from_rest.push_back(pose.world_from_foot * (left ? Mirrored(motion) : motion));
  }
  return posed;
}

Rigid3 StandingPlacement(const Subject& subject) {
  double tip = 0;
  for (const Eigen::Vector3d& v : subject.shape->rest) {
    if (v.z() < 0.06) tip = std::max(tip, v.y());
  }
  Rigid3 world_from_foot;
  world_from_foot.translation = {0, -0.5 * tip, 0};
  return world_from_foot;
}

FootPose StandingPose(const Subject& subject, double ground_z_m) {
  constexpr double kSink = 0.0008;  // how far an unloaded pulp reaches below the ground
  const AnatomyTable& table = subject.shape->table;
  FootPose pose;
  pose.world_from_foot = StandingPlacement(subject);
  for (int toe = 1; toe <= 5; ++toe) {
    double down = -0.5, up = 0.1;
    for (int i = 0; i < 16; ++i) {
      const double middle = 0.5 * (down + up);
      std::map<std::string, double> angles;
      BendToe(toe, middle, angles);
      const double lowest = LowestOfToe(MovedTable(table, BoneMotions(table, angles)), toe);
      (lowest < ground_z_m - kSink ? down : up) = middle;
    }
    BendToe(toe, 0.5 * (down + up), pose.angles_rad);
  }
  return pose;
}

}  // namespace sole::sim
