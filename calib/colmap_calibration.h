#pragma once

#include "calib/calibrate.h"
#include "calib/colmap_rig.h"

namespace sole::calib {

/// Throws Error unless all cameras of the rig are above the plate: COLMAP knows no refraction.
void RequireAllInAir(const RigConfig& config);

/// The calibration that COLMAP alone delivers, for a rig whose cameras are all in air: scale from the
/// target, world frame from the fiducials, the plate as the rig file has it, no covariance. Judged by
/// the same figures as any other, on poses that `colmap` was not made from. Throws Error if a camera
/// is not in air or COLMAP saw too few fiducials for the world frame.
Calibration CalibrationFromColmap(const RigConfig& config, const ColmapRig& colmap,
                                  const DividedTake& take, const CalibrationLimits& limits = {});

}  // namespace sole::calib
