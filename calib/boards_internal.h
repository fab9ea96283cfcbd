#pragma once

#include "calib/boards.h"

namespace sole::calib {

/// Number of the board's dictionary in OpenCV's enumeration. Throws Error naming the known ones.
int DictionaryNumber(const Board& board);

/// Width of the markers' black border, in cells.
int BorderCells(const Board& board);

}  // namespace sole::calib
