#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace sole::sim {

/// One degree of freedom of a joint. Angles are right-handed about `axis` (unit, rest pose, foot frame).
struct AnatomyAxis {
  std::string name;  ///< "dorsiflexion", "inversion", "supination" or "abduction"
  Eigen::Vector3d axis;
  double min_rad = 0;
  double max_rad = 0;
};

/// A bone and the joint that ties it to its parent. Bones are stored parents first; index 0 is the tibia.
struct AnatomyBone {
  std::string name;
  int parent = -1;
  Eigen::Vector3d proximal, distal;
  std::string joint;  ///< short name, such as "talocrural", "mtp_1", "pip_2"
  Eigen::Vector3d joint_centre;
  std::vector<AnatomyAxis> axes;
};

enum class Tissue { kBoneCover, kHeelPad, kBallPad, kToePulp, kTendon, kArchMuscle, kWeb };

/// Blending groups: the body and five toes (hallux = 1).
inline constexpr int kBodyGroup = 0;
inline constexpr int kNumGroups = 6;

/// One implicit shape: a round cone from a to b, or an ellipsoid at `a` whose half axes are the columns of
/// `half_axes` (direction times length). Order within a group matters.
struct FleshPrimitive {
  std::string name;
  bool is_cone = false;
  int group = kBodyGroup;
  Tissue tissue = Tissue::kBoneCover;
  double k = 0;  ///< blend radius, m
  int bone_a = 0, bone_b = 0;
  Eigen::Vector3d a = Eigen::Vector3d::Zero(), b = Eigen::Vector3d::Zero();
  double radius_a = 0, radius_b = 0;
  Eigen::Matrix3d half_axes = Eigen::Matrix3d::Identity();
};

/// A nail: columns of `axes` point across, towards the toe tip and outwards.
struct Nail {
  int bone = 0;
  int toe = 1;
  Eigen::Vector3d centre;
  Eigen::Matrix3d axes;
  double half_width = 0, half_length = 0, exponent = 2;
  double plate_height = 0, groove_depth = 0, groove_width = 0;
};

/// A right foot in its own frame: metres, x lateral, y towards the toes, z up, ground at z = 0, origin
/// under the rearmost point of the heel. The formulas are in the readme of data/foot_anatomy.json.
struct AnatomyTable {
  std::vector<AnatomyBone> bones;
  std::vector<FleshPrimitive> primitives;
  std::vector<Nail> nails;
  double k_body_toes = 0;
  double toe_clearance = 0.0001;  ///< toes that would overlap keep this distance from their mid-surface
  Eigen::Vector3d cut_point = Eigen::Vector3d::Zero();  ///< the cap's plane, on the tibia
  Eigen::Vector3d cut_normal = Eigen::Vector3d::UnitZ();
};

/// The mean adult foot, embedded in the program.
const AnatomyTable& MeanAdultTable();

/// Index of a bone. Throws Error naming an unknown one.
int BoneIndex(const AnatomyTable& table, const std::string& name);

}  // namespace sole::sim
