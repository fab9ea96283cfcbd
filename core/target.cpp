#include "core/target.h"

#include "core/error.h"

namespace sole {

CalibrationBody MakeCalibrationCube(double edge_m, int squares, double square_m, double marker_m) {
  Require(squares >= 3 && square_m > 0 && marker_m > 0 && marker_m < square_m &&
              squares * square_m <= edge_m,
          "calibration cube: needs 3 or more squares a side that fit on its edge, markers smaller than squares");
  // Each face by its outward normal and the direction of the printed rows; printed y runs "down", so that
  // the board's z axis points into the cube.
  struct Side {
    Eigen::Vector3d outward, row;
  };
  const Side sides[] = {{{0, 0, -1}, {1, 0, 0}},
                        {{1, 0, 0}, {0, 1, 0}},
                        {{-1, 0, 0}, {0, -1, 0}},
                        {{0, 1, 0}, {-1, 0, 0}},
                        {{0, -1, 0}, {1, 0, 0}}};
  CalibrationBody body;
  body.edge_m = edge_m;
  int next_id = 0;
  for (const Side& side : sides) {
    const Eigen::Vector3d z = -side.outward, x = side.row, y = z.cross(x);
    Eigen::Matrix3d rotation;
    rotation << x, y, z;
    CharucoFace face{squares, squares, square_m, marker_m, next_id, {}};
    const double half = 0.5 * squares * square_m;
    face.body_from_board.rotation = Eigen::Quaterniond(rotation);
    face.body_from_board.translation = 0.5 * edge_m * side.outward - half * (x + y);
    next_id += MarkerCount(face);
    body.faces.push_back(face);
  }
  return body;
}

Eigen::Vector3d CornerInBody(const CharucoFace& face, int corner) {
  const int columns = face.squares_x - 1;
  return face.body_from_board * Eigen::Vector3d((corner % columns + 1) * face.square_m,
                                                (corner / columns + 1) * face.square_m, 0.0);
}

int MarkerCount(const CharucoFace& face) { return face.squares_x * face.squares_y / 2; }

std::array<Eigen::Vector3d, 4> FiducialCorners(const Fiducial& fiducial) {
  const double h = 0.5 * fiducial.size_m, x = fiducial.centre_m.x(), y = fiducial.centre_m.y();
  return {Eigen::Vector3d(x - h, y + h, 0), Eigen::Vector3d(x + h, y + h, 0),
          Eigen::Vector3d(x + h, y - h, 0), Eigen::Vector3d(x - h, y - h, 0)};
}

}  // namespace sole
