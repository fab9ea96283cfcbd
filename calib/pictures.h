#pragma once

#include <string>
#include <vector>

#include "calib/boards.h"
#include "calib/observations.h"
#include "core/rig.h"

namespace sole::calib {

/// Errors of neighbouring cameras, each point's error as a vector (OpenCV's convention): sqrt of the
/// mean squared distance in pixels, over all points, also those that the adjustment dropped.
struct StereoErrors {
  int views = 0;            ///< seen by both
  double rms_px = 0;        ///< reprojection in both images
  double epipolar_px = 0;   ///< distance from the other image's epipolar line
  double square_rms_mm = 0; ///< triangulated distances of neighbouring corners against the board
};

struct BoardResult {
  /// World frame: that of the first camera. No plate (index 1). Pairs are cameras that follow one another.
  Calibration calibration;
  std::vector<std::vector<double>> view_rms_px;  ///< [frame][camera]; NaN where it is not seen
  std::vector<double> camera_rms_px;
  std::vector<StereoErrors> pairs;  ///< order of calibration.rig.pairs
  int dropped = 0;                  ///< corners the adjustment left out
};

/// A camera whose pictures are calibrated.
struct ImageCamera {
  std::string name;
  int width = 0;
  int height = 0;
};

/// Calibrates one or more cameras that do not move against each other from pictures of one flat
/// board, whole or in parts: intrinsics with k1 k2 p1 p2 k3 and poses, adjusted jointly. Throws Error
/// naming the camera that sees the board in fewer than `min_views` pictures, sees it mirrored, or
/// shares no picture with the others; or if the corners contradict each other.
BoardResult CalibrateBoards(const std::vector<ImageCamera>& cameras,
                            const TakeObservations& observations, const Board& board,
                            int min_views = 5);

/// What calibrated cameras make of a board that was not used to calibrate them.
struct BoardScale {
  int lengths = 0;    ///< between its corners, triangulated from two cameras or more; 0: not judged
  double rms_mm = 0;  ///< of their errors
  double scale = 1;   ///< measured over given lengths
};
BoardScale JudgeBoard(const Rig& rig, const TakeObservations& take, const Board& board);

}  // namespace sole::calib
