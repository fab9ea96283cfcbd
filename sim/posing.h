#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/rigid3.h"
#include "sim/subject.h"

namespace sole::sim {

/// Joint angles by JointAxis::name; absent ones are 0. `fixed_bone` keeps its rest place in the foot
/// frame, which world_from_foot then carries into the world.
struct FootPose {
  std::map<std::string, double> angles_rad;
  std::string fixed_bone = "calcaneus";
  Rigid3 world_from_foot;
};

struct PosedFoot {
  std::vector<Eigen::Vector3d> vertices_m;  ///< world frame; triangles are FootTriangles(subject.side)
  std::vector<Rigid3> world_from_rest;      ///< per bone, in the order of Bones(): rest pose to world
};

/// Poses the unloaded foot: bones move, the skin is brought back to the posed flesh. Angles beyond a joint's
/// range are limited to it. Throws Error for an unknown angle or bone name.
PosedFoot PoseFoot(const Subject& subject, const FootPose& pose);

/// As PoseFoot, but the skin is only carried along by the bones: some tenths of a millimetre off where joints bend little.
PosedFoot CarryFoot(const Subject& subject, const FootPose& pose);

/// Carries the foot frame into the world so that the foot's middle stands above the plate's centre, toes
/// towards +y.
Rigid3 StandingPlacement(const Subject& subject);

/// Bends the toes (MTP and PIP) until their pulps reach `sink_m` below the plate z = 0, as a standing person's do. `foot_from_world` brings
/// the plate into the foot frame; the other angles of the pose stay.
void LowerToes(const Subject& subject, const Rigid3& foot_from_world, double sink_m, FootPose& pose);

/// Otherwise at rest, the unloaded foot stands with its toes lowered to the plate.
FootPose StandingPose(const Subject& subject);

}  // namespace sole::sim
