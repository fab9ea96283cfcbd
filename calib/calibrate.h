#pragma once

#include "calib/adjust.h"
#include "calib/detect.h"
#include "calib/observations.h"
#include "calib/verdict.h"
#include "core/frame_set.h"
#include "core/rig.h"
#include "core/rig_config.h"

namespace sole::calib {

struct CalibrateOptions {
  DetectOptions detect;
  AdjustOptions adjust;
  CalibrationLimits limits;
  bool ignore_plate = false;  ///< as if there were no glass: shows what that costs, fails honestly
  int heldout_every = 5;      ///< every fifth pose of the target judges instead of being adjusted
  int min_poses = 6;          ///< usable poses without which no calibration is tried
  int min_camera_frames = 3;  ///< frames in which every camera must see the target
  double max_outlier_share = 0.2;  ///< of all points; more means that they do not fit together
  double max_fiducial_sigmas = 5;  ///< RMS displacement of the fiducials over their tolerance
  int min_frame_corners = 8;       ///< corners over all cameras that make a frame usable
};

/// Corners in all frame sets of `takes`; frames lit by speckle are left out if there are others.
/// Throws Error if an image has the wrong size.
TakeObservations Observe(const RigConfig& config, FrameSource& takes,
                         const DetectOptions& options = {});

/// Poses of a take, divided into those to adjust and those to judge by. The fiducials, averaged over
/// the take, stand in the first frame of `adjust`.
struct DividedTake {
  TakeObservations adjust, heldout;
};

/// Throws Error as Calibrate does if poses, views or fiducials do not suffice.
DividedTake DivideTake(const RigConfig& config, const TakeObservations& observations,
                       const CalibrateOptions& options = {});

/// The figures of `stats` that held-out poses and fiducials tell about a calibrated rig, and the
/// failures that follow from them. Distances that nobody saw are NaN.
void JudgeRig(const Rig& rig, const RigConfig& config, const DividedTake& take,
              const CalibrationLimits& limits, CalibrationStats& stats);

/// Cameras as pairs of the rig, with the hash of the rig file.
void CompleteRig(const RigConfig& config, Rig& rig);

/// ISO 8601, UTC, as Calibration::created.
std::string NowUtc();

/// Calibrates all cameras of the rig and the plate's thickness from pictures of the calibration
/// cube in many poses. The index of the glass is the rig file's (data sheet): it cannot be told
/// from the thickness. Result in the world frame of docs/conventions.md, which the plate's
/// fiducials define.
///
/// Throws Error if there are too few poses, a camera never sees the target, no fiducial is seen, an
/// image has another size than the rig file says, the points contradict each other (a target or
/// fiducials of other sizes) or do not determine the cameras.
Calibration Calibrate(const RigConfig& config, FrameSource& takes,
                      const CalibrateOptions& options = {});

/// The same from corners that were measured before.
Calibration CalibrateFromObservations(const RigConfig& config, const TakeObservations& observations,
                                      const CalibrateOptions& options = {});

}  // namespace sole::calib
