#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/observations.h"
#include "core/camera.h"
#include "core/plate.h"

namespace sole::calib {

/// All unknowns of the joint adjustment.
struct AdjustState {
  std::vector<Camera> cameras;
  Plate plate;                                     ///< the index is kept, the thickness estimated
  std::vector<Rigid3> world_from_body;             ///< pose of the target, one per frame
  std::vector<Eigen::Vector2d> fiducial_offset_m;  ///< etching error of each fiducial in x and y
};

struct AdjustOptions {
  double huber_sigmas = 2.0;              ///< where the loss turns linear, in standard deviations
  double outlier_sigmas = 4.0;            ///< observations beyond are dropped before the last solve
  double fiducial_tolerance_m = 0.00002;  ///< standard deviation of an etched fiducial's place
  double thickness_tolerance_m =
      0.0003;  ///< standard deviation of the nominal thickness (float glass)
  bool estimate_thickness = true;
  bool estimate_k3 =
      false;  ///< k3 is weakly determined by lenses of 30 degrees: kept at its start value
  std::vector<bool> keep_pose;        ///< cameras whose pose is known; empty: none
  std::vector<bool> keep_intrinsics;  ///< cameras whose intrinsics are known; empty: none
  int max_iterations = 100;
  int threads = 1;  ///< results repeat bit by bit only with 1
};

struct AdjustResult {
  AdjustState state;
  double reprojection_rms_px = 0;  ///< per image coordinate, over target and fiducials
  std::vector<double> camera_rms_px;
  std::vector<int> camera_corners;  ///< observations kept
  int outliers = 0;                 ///< observations dropped
  double sigma0 = 0;  ///< RMS of residuals over their sigmas; 1 if the sigmas were right
  bool converged = false;
  int iterations = 0;
  Eigen::MatrixXd covariance;  ///< order and meaning of Calibration::covariance, scaled by sigma0^2
};

/// Least-squares adjustment of cameras, target poses, plate thickness and fiducials to all
/// observations, projected exactly through the plate. The world frame is the plate's (z = 0 is its
/// top), so the plate has no pose of its own: its normal is part of the camera poses. Fiducials fix
/// origin, heading, tilt and height, the target fixes the scale. First robust (Huber), then again
/// without outliers.
///
/// `observations` must have as many frames as `start` has target poses; frames may be empty.
AdjustResult Adjust(const AdjustState& start, const TakeObservations& observations,
                    const std::vector<Eigen::Vector3d>& target_corners,
                    const std::vector<Eigen::Vector3d>& fiducial_corners,
                    const AdjustOptions& options = {});

}  // namespace sole::calib
