#pragma once

#include <string>
#include <vector>

#include "core/rig.h"

namespace sole::calib {

/// Largest errors of a calibration that may be used, millimetres. Contact with the glass is told at
/// 0.1 mm, so that everything that displaces a whole view stays below a third of it.
struct CalibrationLimits {
  double heldout_air_mm = 0.03;
  double heldout_glass_mm = 0.04;
  double heldout_across_mm = 0.04;
  double heldout_max_mm = 0.3;  ///< of single distances, noise of both ends included
  double pair_offset_mm = 0.03;
  double ground_mm = 0.02;
  double rejected_share = 0.02;  ///< of the held-out points
};

/// One line per figure beyond its limit, naming figure and limit; empty if all are within, or
/// nothing could be judged.
std::vector<std::string> Failures(const Rig& rig, const CalibrationStats& stats,
                                  const CalibrationLimits& limits = {});

}  // namespace sole::calib
