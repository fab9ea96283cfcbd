#pragma once

#include <string>
#include <vector>

#include "calib/colmap_rig.h"
#include "core/rig.h"

namespace sole::calib {

/// How far two estimates of a camera may lie apart before one of them must be wrong. Judged is what
/// they see: centre, direction and lens can give way to each other and still see the same.
struct AgreementLimits {
  double view_px = 0.1;  ///< 0.02 mm where a foot stands
};

/// One camera as COLMAP found it, against ours.
struct CameraAgreement {
  std::string serial;
  double centre_mm = 0;      ///< distance of the centres
  double direction_deg = 0;  ///< angle between the optical axes; tied to the principal point
  double focal_px = 0;       ///< COLMAP's focal length minus ours
  double view_px = 0;        ///< RMS distance of where both see the target's corners
  bool agrees = true;
};

struct Agreement {
  std::vector<CameraAgreement> cameras;  ///< those in air
  double scale = 1;  ///< by which COLMAP's rig, scaled by the target, must grow to be as large as ours
  double centre_rms_mm = 0, direction_rms_deg = 0, view_rms_px = 0;
};

/// Lays COLMAP's rig onto ours, by rotation and shift, so that both see the target's corners at the
/// same pixels, and compares. A camera that disagrees with the others hardly counts (robust weights),
/// so that it does not drag them along; of two cameras alone nobody can tell which one is wrong.
/// `ours` holds all cameras of `colmap`.
Agreement CompareWithColmap(const Rig& ours, const ColmapRig& colmap, const AgreementLimits& limits = {});

}  // namespace sole::calib
