#pragma once

#include <array>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "calib/observations.h"
#include "core/image.h"

namespace sole::calib {

enum class BoardKind { kChessboard, kCharuco, kAprilGrid };

/// A flat board. What its numbers count:
/// - chessboard: inner corners; `size_m` is the edge of a square;
/// - ChArUco (OpenCV 4.6 and later: the first square is black, white ones hold markers 0, 1, ...
///   row by row; `legacy`: as OpenCV before 4.6 drew boards with an even number of rows, the first
///   square white): squares; `size_m` is the edge of a square, `marker_m` that of a marker;
/// - AprilGrid (Kalibr: tag36h11 with a border of two cells, ids row by row from the lower left,
///   black squares where four gaps meet): tags; `size_m` is the edge of a tag, `gap_m` between.
struct Board {
  BoardKind kind = BoardKind::kChessboard;
  int columns = 0;
  int rows = 0;
  double size_m = 0;
  double marker_m = 0;
  double gap_m = 0;
  std::string dictionary;  ///< of OpenCV, without DICT_; empty for a chessboard
  bool legacy = false;
};

/// From "chessboard:9x6:25mm", "charuco:7x5:30mm:22mm:5X5_250" (that dictionary may be left out;
/// ":legacy" may follow it) or "aprilgrid:6x6:35mm:0.3" (tag, gap over tag). Lengths without unit
/// are metres. Throws Error saying what is wrong.
Board ParseBoard(const std::string& text);
/// The same text from a board.
std::string FormatBoard(const Board& board);

/// Corners in the board's frame, in metres, numbered row by row. Chessboard and ChArUco: inner
/// corners, x along the rows, y down; ChArUco's origin is the board's first corner, a chessboard's
/// its first inner corner. AprilGrid: the tags' corners from the lower left, x right, y up, origin
/// the first (Kalibr's order and frame).
std::vector<Eigen::Vector3d> BoardCorners(const Board& board);

/// Corners of a row; a corner and the one after it in its row, or below it, are neighbours.
int CornersInRow(const Board& board);

/// A marker of a ChArUco board or AprilGrid in the board's frame, corners clockwise in the order
/// in which OpenCV finds them: from the upper left of its own picture of the marker. AprilGrids
/// have it turned upside down, so from their tags' lower right.
struct BoardMarker {
  int id = 0;
  std::array<Eigen::Vector2d, 4> corners;
};
std::vector<BoardMarker> BoardMarkers(const Board& board);

/// Cells of a marker as printed, with its black border, row by row from the upper left, 1 where
/// white.
struct MarkerCells {
  int side = 0;
  std::vector<unsigned char> white;
};
MarkerCells CellsOf(const Board& board, int id);

/// The board's corners in an image. Of a chessboard all or none; if one number of its corners is
/// even and the other odd they begin at a black square, otherwise at the end nearer to the upper
/// left. Of the others every corner beside a legible marker, whatever part is in view; markers of
/// other boards or in places that contradict the rest are left out. `mirrored_target` is set where
/// markers are legible only in the flipped image.
ViewObservations DetectBoard(const ImageU8& image, const Board& board);

}  // namespace sole::calib
