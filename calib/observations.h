#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/rig_config.h"
#include "core/target.h"

namespace sole::calib {

/// One measured image point. `point` indexes TargetCorners or FiducialCornerPoints; `sigma_px` is
/// the standard deviation of each image coordinate.
struct PointObservation {
  int point = -1;
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
  double sigma_px = 0.05;
};

/// What one camera saw at one trigger; both empty where it saw nothing or delivered no image.
struct ViewObservations {
  std::vector<PointObservation> target;
  std::vector<PointObservation> fiducials;
  bool mirrored_target = false;  ///< the target is legible only in the flipped image
};

/// frames[f][c]: frame f of the take, camera c in rig order. The target stands in another pose in
/// every frame; cameras and fiducials do not move.
struct TakeObservations {
  std::vector<std::vector<ViewObservations>> frames;
};

/// All inner chessboard corners of the body in the body frame, face after face in CornerInBody's
/// order (m).
std::vector<Eigen::Vector3d> TargetCorners(const CalibrationBody& body);

/// Corners of all fiducials in the world frame, four per fiducial in FiducialCorners' order (m).
std::vector<Eigen::Vector3d> FiducialCornerPoints(const PlateConfig& plate);

/// Fiducials do not move, so a camera's views of each corner in all frames become one: the mean
/// around their median. Its sigma keeps `sigma_floor_px`, which repetition does not average away.
std::vector<PointObservation> MeanFiducials(const TakeObservations& observations,
                                            std::size_t camera, double sigma_floor_px);

}  // namespace sole::calib
