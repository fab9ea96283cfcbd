#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "calib/observations.h"
#include "core/camera.h"
#include "core/rig_config.h"
#include "io/colmap_model.h"

namespace sole::calib {

struct ColmapProblemOptions {
  int max_frames = 40;  ///< poses of the target at most, evenly chosen
  int min_points = 12;  ///< points that an image must show to be used
  double fiducial_sigma_floor_px = 0.04;
};

/// True if the camera stands above the plate, by its nominal position.
bool InAir(const CameraConfig& camera);

/// What COLMAP is asked, which knows neither glass nor our target. The cameras in air with nominal intrinsics, and one image of every pose and camera. To COLMAP the target
/// stands still and the rig moves around it: that gives every camera many images of the same points.
/// Points are the corners of the target in its own frame, then those of the fiducials in the world
/// frame; fiducials stand in the images of one pose only, since they move with the rig. COLMAP is
/// given pixels and which of them belong together, no positions and no poses.
///
/// Image names are cameraNN/FFFFFF.png: camera of the model and frame of the take, from 1. Throws
/// Error if fewer than two cameras are in air, or one of them has no image.
io::ColmapModel MakeColmapProblem(const RigConfig& config, const TakeObservations& observations,
                                  const ColmapProblemOptions& options = {});

/// Prefix of the image names of a camera of the problem.
std::string ColmapImagePrefix(std::size_t camera);

/// Residual beyond which pixels of a solved model are wrong: five times the median, 0.1 px at least.
/// Nothing if no pixel is beyond it.
std::optional<double> OutlierLimitPx(const io::ColmapModel& solved);

/// Camera that shares poses with most of the others in a solved model and has most images among
/// those: COLMAP's rig adjustment wants one. Index into `solved.cameras`.
int ReferenceCamera(const io::ColmapModel& solved);

/// The rig as COLMAP found it, in metres: the known target gives the scale.
struct ColmapRig {
  std::vector<Camera> cameras;  ///< those in air, in rig order; in the world frame if `in_world`
  bool in_world = false;        ///< else in the target's frame at one pose: fiducials did not suffice
  /// For each camera the target's corners that it sees, in the frame of the cameras (m).
  std::vector<std::vector<Eigen::Vector3d>> seen_m;
  int images = 0;         ///< of the problem
  int images_placed = 0;  ///< of those, in the result
  std::vector<int> camera_points;     ///< points seen by each camera
  std::vector<double> camera_rms_px;  ///< per image coordinate
  double reprojection_rms_px = 0;
  double target_rms_mm = 0;    ///< COLMAP's target against the known one
  double fiducial_rms_mm = 0;  ///< COLMAP's fiducials against their known places; NaN unless in_world
};

/// Reads a solved model of `problem` in which the cameras of each pose form the same rig (as
/// rig_bundle_adjuster leaves it). Throws Error if a camera or the target was not found.
ColmapRig ReadColmapRig(const io::ColmapModel& problem, const io::ColmapModel& solved,
                        const RigConfig& config);

}  // namespace sole::calib
