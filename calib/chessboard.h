#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "core/image.h"
#include "core/rig.h"

namespace sole::calib {

/// A plain chessboard: inner corners along the rows and along the columns.
struct Chessboard {
  int columns = 0;
  int rows = 0;
  double square_m = 0;
};

/// From "9x6:25mm" or "9x6:0.025" (metres). Throws Error saying what is wrong.
Chessboard ParseChessboard(const std::string& text);

/// All inner corners row by row; empty if the whole board is not seen. Boards with an even and an odd
/// number of corners begin at a black square, others at the corner nearer to the image's upper left,
/// as they look the same after half a turn.
std::vector<PointObservation> DetectChessboard(const ImageU8& image, const Chessboard& board);

/// Errors of neighbouring cameras, each point's error as a vector (OpenCV's convention): sqrt of the
/// mean squared distance in pixels, over all points, also those that the adjustment dropped.
struct StereoErrors {
  int views = 0;            ///< seen by both
  double rms_px = 0;        ///< reprojection in both images
  double epipolar_px = 0;   ///< distance from the other image's epipolar line
  double square_rms_mm = 0; ///< triangulated distances of neighbouring corners against square_m
};

struct ChessboardResult {
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

/// Calibrates one or more cameras that do not move against each other from pictures of one
/// chessboard: intrinsics with k1 k2 p1 p2 k3 and poses, adjusted jointly. Throws Error naming the
/// camera that sees the board in fewer than `min_views` pictures, or shares none with the others.
ChessboardResult CalibrateChessboards(const std::vector<ImageCamera>& cameras,
                                      const TakeObservations& observations,
                                      const Chessboard& board, int min_views = 5);

}  // namespace sole::calib
