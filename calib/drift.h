#pragma once

#include <string>
#include <vector>

#include "calib/observations.h"
#include "core/rig.h"
#include "core/rig_config.h"

namespace sole::calib {

/// A point that two cameras of a pair both saw.
struct PairMatch {
  int pair = -1;
  Eigen::Vector2d left_px, right_px;
};

struct DriftOptions {
  double min_residual_px = 0.25;  ///< below this a camera counts as unmoved
  int min_corners = 8;            ///< of fiducials or target, to judge a camera
};

/// How well one camera of a calibration still fits.
struct CameraDrift {
  std::string serial;
  int fiducial_corners = 0;
  int target_corners = 0;
  double residual_px = 0;        ///< RMS of their distances from where the calibration puts them
  double residual_after_px = 0;  ///< the same when this camera's pose is estimated anew
  double moved_mm = 0;           ///< of its centre
  double turned_deg = 0;
  double moved_sigma_mm = 0;  ///< standard deviation of moved_mm
  bool judged = false;        ///< false: too few points
  bool moved = false;
  Rigid3 cam_from_world;  ///< estimated anew
};

struct PairDrift {
  std::string name;
  int matches = 0;
  double gap_px = 0;        ///< RMS distance from the epipolar curve; 0 without matches
  double gap_after_px = 0;  ///< with the cameras that moved in their new places
};

struct DriftReport {
  std::vector<CameraDrift> cameras;  ///< rig order
  std::vector<PairDrift> pairs;      ///< rig order
  std::vector<int> moved;            ///< cameras, indices
  bool everything_moved = false;     ///< most cameras did: rather the plate, or another rig
};

/// Scores a later take of the rig against `calibration`: each camera's fiducials (known places on
/// the glass), the target's corners where it is in the take (its pose comes from the other cameras)
/// and matches of pairs. A camera whose points lie elsewhere, and on the spot once its pose is
/// estimated anew, has moved. Throws Error if no camera can be judged.
DriftReport CheckDrift(const Calibration& calibration, const RigConfig& config,
                       const TakeObservations& observations, const std::vector<PairMatch>& matches,
                       const DriftOptions& options = {});

/// The calibration with camera `camera` in its new place, estimated from its fiducials and the target
/// with all else kept. Its covariance takes the new pose's variance, without correlations to others.
/// Held-out figures are measured anew on the target if the take has enough of it, otherwise NaN.
Calibration ReadjustCamera(const Calibration& calibration, const RigConfig& config,
                           const TakeObservations& observations, int camera);

}  // namespace sole::calib
