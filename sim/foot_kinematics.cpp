#include "sim/foot_kinematics.h"

#include <algorithm>
#include <set>

#include "core/error.h"

namespace sole::sim {
namespace {

Rigid3 RotationAbout(const Eigen::Vector3d& centre, const Eigen::Quaterniond& rotation) {
  return {rotation, centre - rotation * centre};
}

void RejectUnknownAngles(const AnatomyTable& table, const std::map<std::string, double>& angles_rad) {
  std::set<std::string> known;
  for (const AnatomyBone& bone : table.bones) {
    for (const AnatomyAxis& axis : bone.axes) known.insert(AngleName(bone, axis));
  }
  for (const auto& [name, value] : angles_rad) {
    Require(known.contains(name),
            "unknown joint angle '" + name + "': use the names of JointAxes, such as mtp_1.dorsiflexion");
  }
}

}  // namespace

std::string AngleName(const AnatomyBone& bone, const AnatomyAxis& axis) { return bone.joint + "." + axis.name; }

std::vector<Rigid3> BoneMotions(const AnatomyTable& table, const std::map<std::string, double>& angles_rad) {
  RejectUnknownAngles(table, angles_rad);
  std::vector<Rigid3> motions;
  for (const AnatomyBone& bone : table.bones) {
    Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
    for (const AnatomyAxis& axis : bone.axes) {
      const auto found = angles_rad.find(AngleName(bone, axis));
      if (found == angles_rad.end()) continue;
      const double angle = std::clamp(found->second, axis.min_rad, axis.max_rad);
      rotation = rotation * Eigen::Quaterniond(Eigen::AngleAxisd(angle, axis.axis));
    }
    const Rigid3 own = RotationAbout(bone.joint_centre, rotation);
    motions.push_back(bone.parent < 0 ? own : motions[static_cast<std::size_t>(bone.parent)] * own);
  }
  return motions;
}

AnatomyTable MovedTable(const AnatomyTable& table, const std::vector<Rigid3>& motions) {
  const auto motion = [&](int bone) -> const Rigid3& { return motions[static_cast<std::size_t>(bone)]; };
  AnatomyTable moved = table;
  for (std::size_t i = 0; i < moved.bones.size(); ++i) {
    AnatomyBone& bone = moved.bones[i];
    bone.proximal = motions[i] * bone.proximal;
    bone.distal = motions[i] * bone.distal;
    bone.joint_centre = motions[i] * bone.joint_centre;
    const Rigid3& axis_motion = bone.parent < 0 ? motions[i] : motion(bone.parent);
    for (AnatomyAxis& axis : bone.axes) axis.axis = axis_motion.rotation * axis.axis;
  }
  for (FleshPrimitive& p : moved.primitives) {
    const Rigid3& a = motion(p.bone_a);
    const Rigid3& b = motion(p.bone_b);
    if (p.is_cone) {
      p.a = a * p.a;
      p.b = b * p.b;
      continue;
    }
    const Eigen::Quaterniond half = a.rotation.slerp(0.5, b.rotation);
    p.a = 0.5 * (a * p.a + b * p.a);
    p.half_axes = half * p.half_axes;
  }
  for (Nail& nail : moved.nails) {
    nail.centre = motion(nail.bone) * nail.centre;
    nail.axes = motion(nail.bone).rotation * nail.axes;
  }
  moved.cut_point = motions[0] * moved.cut_point;
  moved.cut_normal = motions[0].rotation * moved.cut_normal;
  return moved;
}

}  // namespace sole::sim
