#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/rigid3.h"
#include "sim/anatomy_table.h"

namespace sole::sim {

/// Motion of each bone from the table's pose, about its joints, angles by "<joint>.<axis name>" (radians, limited to the
/// joint's range). "midtarsal" drives navicular and cuboid alike. The tibia stays. Throws Error for an unknown angle.
std::vector<Rigid3> BoneMotions(const AnatomyTable& table, const std::map<std::string, double>& angles_rad);

/// The table with its bones moved: flesh, nails and the cut follow as the readme of the anatomy says.
AnatomyTable MovedTable(const AnatomyTable& table, const std::vector<Rigid3>& motions);

/// One degree of freedom: "<joint>.<axis name>".
std::string AngleName(const AnatomyBone& bone, const AnatomyAxis& axis);

}  // namespace sole::sim
