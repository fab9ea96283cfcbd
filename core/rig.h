#pragma once

#include <optional>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/camera.h"
#include "core/ground_surface.h"
#include "core/plate.h"

namespace sole {

/// Two cameras whose views overlap enough to be matched; indices into Rig::cameras.
struct StereoPair {
  std::string name;
  int left = -1;
  int right = -1;
};

/// A calibrated rig: the result of calibration and all that reconstruction needs.
struct Rig {
  std::vector<Camera> cameras;
  std::vector<StereoPair> pairs;
  Plate plate;
  std::string rig_hash;  ///< RigIdentityHash of the rig file it was made for
};

/// True if `camera` looks at the world above the plate through the glass.
inline bool LooksThroughPlate(const Camera& camera, const Plate& plate) {
  return camera.CentreInWorld().z() < -plate.thickness_m;
}

/// Quality of a calibration. Lengths in millimetres only here, because this is what reports print.
struct CalibrationStats {
  double reprojection_rms_px = 0;     ///< per image coordinate
  std::vector<double> camera_rms_px;  ///< per camera, rig order
  std::vector<int> camera_corners;    ///< observations per camera
  double heldout_rms_air_mm = 0;      ///< distances on held-out target poses, cameras above the plate
  double heldout_rms_glass_mm = 0;    ///< the same, cameras below
  double heldout_rms_across_mm = 0;   ///< from points seen above to points seen below
  double heldout_max_mm = 0;          ///< of all these distances
  int heldout_points = 0;             ///< held-out points seen by two cameras of one side
  int heldout_rejected = 0;           ///< held-out points whose rays miss each other
  double ground_rms_mm = 0;           ///< distance of triangulated fiducials to z = 0
  int poses_used = 0;
  int poses_heldout = 0;
  std::vector<double> pair_offset_mm;    ///< of the held-out body as each pair sees it; NaN: unseen
  std::vector<double> pair_epipolar_px;  ///< RMS miss of held-out points by epipolar curves
  std::vector<std::string> failures;  ///< why it must not be used, in words; empty: it passed
};

/// A calibration with its uncertainty. The covariance is of the stacked parameters, per camera
/// [rotation vector of cam_from_world (3, rad), translation (3, m), intrinsics (9)] in rig order, then the
/// plate's thickness (m). The rotation vector w is a small turn on the left of the estimate,
/// R = exp(w) R_estimated. Rows of parameters that were not estimated are zero.
struct Calibration {
  Rig rig;
  CalibrationStats stats;
  Eigen::MatrixXd covariance;
  std::string created;  ///< ISO 8601, UTC
  std::optional<GroundSurface> ground;  ///< where a sheet on the glass has shown it
};

}  // namespace sole
