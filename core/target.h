#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "core/rigid3.h"

namespace sole {

/// A flat ChArUco board: a chessboard of squares_x by squares_y squares whose white squares hold markers of
/// a dictionary, numbered from first_id in OpenCV's order. Board frame: origin at the board's first corner, x and y along
/// the printed rows and columns in OpenCV's order (z = x cross y, INTO the board, away from the viewer,
/// because printed y runs down), metres.
struct CharucoFace {
  int squares_x = 0;
  int squares_y = 0;
  double square_m = 0;
  double marker_m = 0;
  int first_id = 0;
  Rigid3 body_from_board;
};

/// A rigid body that carries ChArUco faces.
struct CalibrationBody {
  std::vector<CharucoFace> faces;
  double edge_m = 0;  ///< edge of the cube
};

/// A square marker etched into the glass top (z = 0), upright to a viewer above the plate: its top edge
/// points to +y. `centre_m` in world x, y.
struct Fiducial {
  int id = 0;
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();
  double size_m = 0;
};

/// The standard cube: 6 faces minus the one it is held by (top, +z) = 5 faces of squares x squares squares,
/// centred on each side of a cube of edge `edge_m`, marker ids 0, 1, ... face after face in the order
/// -z, +x, -x, +y, -y. Body frame: origin at the cube's centre.
CalibrationBody MakeCalibrationCube(double edge_m, int squares, double square_m, double marker_m);

/// Position in the body frame of inner chessboard corner `corner` of a face (row by row, OpenCV's order;
/// (squares_x - 1) * (squares_y - 1) corners).
Eigen::Vector3d CornerInBody(const CharucoFace& face, int corner);

/// Number of markers on a face: one per white square.
int MarkerCount(const CharucoFace& face);

/// World positions of a fiducial's corners in OpenCV's marker order (top-left, top-right, bottom-right, bottom-left
/// as seen from above with +y up and +x right).
std::array<Eigen::Vector3d, 4> FiducialCorners(const Fiducial& fiducial);

}  // namespace sole
