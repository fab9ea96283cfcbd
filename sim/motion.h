#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "sim/soft_contact.h"

namespace sole::sim {

struct MotionOptions {
  std::string motion = "stand";  ///< a name of MotionNames()
  int frames = 10;
  double rate_hz = 10;
  double start_s = 0;  ///< time of the first frame; the motion itself stays the same
  std::uint64_t seed = 1;
  double mean_load = 0.5;  ///< of body weight, while standing and rocking; the most while pressing
  std::optional<PlateModel> plate = {};  ///< bends under the foot; absent: the plate is rigid
  /// Where the foot stands: its middle from the plate's, and its turn to the left about the vertical, on top of a few drawn
  /// millimetres and degrees. (0.2, 0) puts it half off the default plate.
  Eigen::Vector2d offset_m = Eigen::Vector2d::Zero();
  double heading_rad = 0;
};

struct MotionFrame {
  double time_s = 0;
  LoadedFoot foot;                           ///< contact vectors are all zero in the air
  std::map<std::string, double> angles_rad;  ///< by JointAxis::name
};

struct FootMotion {
  std::vector<Eigen::Vector3i> triangles;
  std::vector<MotionFrame> frames;
};

/// "stand": quiet standing with sway; "rock": the load goes from heel to forefoot and back, once over all frames; "press": a foot that
/// holds its joints is lowered onto the plate, loaded up to `mean_load` by a weight that wanders over it and lifted again, so that one
/// pose is seen under every load; "air": ankle and
/// toe movement 20 to 60 mm above the plate; "walk", "run" and "jump": the foot comes down on the plate, in real time from 0.1 to
/// 0.2 s before (step_motion.h); "toes": curls and spreads above the plate, the rest of the foot held still.
const std::vector<std::string>& MotionNames();
/// The same as prose: "stand, rock, ... or toes".
std::string MotionList();

/// Throws Error for an unknown motion, listing the known ones, or for impossible options.
FootMotion MakeMotion(const Subject& subject, const MotionOptions& options);

}  // namespace sole::sim
