#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "calib/boards.h"
#include "core/mesh.h"
#include "core/rig_config.h"
#include "io/print_sheet.h"

namespace sole::calib {

/// A corner of a target: where it is printed, and where it is on the target.
struct PrintedCorner {
  int id = 0;  ///< number in BoardCorners, or TargetCorners of a cube
  Eigen::Vector2d page_m = Eigen::Vector2d::Zero();    ///< from the page's upper left, y down
  Eigen::Vector3d target_m = Eigen::Vector3d::Zero();  ///< in the board's or body's frame
};

struct PrintedSheet {
  std::string name;  ///< "board" or the cube's face, such as "face +x"
  io::PrintSheet page;
  std::vector<PrintedCorner> corners;
  Eigen::Vector2d bar_from_m = Eigen::Vector2d::Zero();  ///< ends of the scale bar on the page,
  Eigen::Vector2d bar_to_m = Eigen::Vector2d::Zero();    ///< middle of its height
};

/// What is printed of a board, at the middle of a page: auto, the smallest of A4 to A0 that holds
/// it (or its own size beyond), A4 ... A0, or WIDTHxHEIGHT in millimetres. A scale bar of 100 mm
/// and how to print it stand below. Throws Error if the page is unknown or too small.
PrintedSheet DrawBoard(const Board& board, const std::string& page = "auto");

/// The five faces of the calibration cube, one page each, with marks to cut along.
std::vector<PrintedSheet> DrawCube(const TargetConfig& cube, const std::string& page = "auto");

/// The speckled sheet that is laid on the glass to find its top, a page for each side.
std::vector<PrintedSheet> DrawContactSheet(const SheetConfig& sheet,
                                           const std::string& page = "auto");

/// The body that the faces are glued on: a cube of this edge around the origin.
TriangleMesh CubeBody(double edge_m);

}  // namespace sole::calib
