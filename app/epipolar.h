#pragma once

#include <string>
#include <vector>

#include "capture/take_finding.h"
#include "core/frame_set.h"
#include "core/rig.h"

namespace sole::app {

/// How well one pair still fits its calibration.
struct EpipolarOffset {
  std::string pair;
  std::string left, right;  ///< serials
  int matches = 0;
  double offset_px = 0;  ///< median distance of corresponding rays across the epipolar plane, pixels
                         ///< of the right camera, signed
  double sd_px = 0;      ///< standard error of the median
};

/// Quick check for bumped cameras: matches some hundred lit patches of each pair and intersects
/// their rays, through the glass where it lies between. A pair whose images show nothing to match
/// has no matches.
std::vector<EpipolarOffset> EpipolarOffsets(const FrameSet& set, const Rig& rig);

/// The same for some speckle sets of a take; a finding names every pair beyond `limit_px`.
std::vector<capture::TakeFinding> CheckCalibration(const std::string& take, const Rig& rig,
                                                   double limit_px = 0.3);

}  // namespace sole::app
