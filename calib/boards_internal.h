#pragma once

#include "calib/boards.h"

namespace sole::calib {

/// Number of the board's dictionary in OpenCV's enumeration. Throws Error naming the known ones.
int DictionaryNumber(const Board& board);

/// Whether a square of a ChArUco board is white and holds a marker.
bool IsWhite(const Board& board, int column, int row);

/// Width of the markers' black border, in cells.
int BorderCells(const Board& board);

/// All inner corners of a chessboard row by row; empty if the whole board is not seen. Boards with
/// an even and an odd number of corners begin at a black square, others at the corner nearer to the
/// image's upper left, as they look the same after half a turn. A mirrored chessboard looks like
/// one that is not.
std::vector<PointObservation> DetectChessboard(const ImageU8& image, const Board& board);

}  // namespace sole::calib
