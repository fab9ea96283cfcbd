#include "calib/colmap_calibration.h"

#include <string>

#include "core/error.h"

namespace sole::calib {

void RequireAllInAir(const RigConfig& config) {
  int below = 0;
  for (const CameraConfig& camera : config.cameras) below += InAir(camera) ? 0 : 1;
  Require(below == 0, "--method colmap: " + std::to_string(below) + " of " +
                          std::to_string(config.cameras.size()) +
                          " cameras look through the glass, which COLMAP does not know; use --method both, which "
                          "calibrates all cameras and has COLMAP check those in air");
}

Calibration CalibrationFromColmap(const RigConfig& config, const ColmapRig& colmap,
                                  const DividedTake& take, const CalibrationLimits& limits) {
  RequireAllInAir(config);
  Require(colmap.in_world, "--method colmap: COLMAP saw fewer than two fiducials of the plate, which define the world "
                           "frame; check [[plate.fiducial]] in the rig file, light and focus");
  Calibration result;
  result.rig.cameras = colmap.cameras;
  result.rig.plate = {config.plate.thickness_m, config.plate.index};
  CompleteRig(config, result.rig);
  result.stats.reprojection_rms_px = colmap.reprojection_rms_px;
  result.stats.camera_rms_px = colmap.camera_rms_px;
  result.stats.camera_corners = colmap.camera_points;
  JudgeRig(result.rig, config, take, limits, result.stats);
  result.created = NowUtc();
  return result;
}

}  // namespace sole::calib
