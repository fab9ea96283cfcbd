#include "calib/boards.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>

#include "calib/boards_internal.h"
#include "core/error.h"

namespace sole::calib {
namespace {

struct DictionaryName {
  const char* name;
  int number;
};
constexpr DictionaryName kDictionaries[] = {
    {"4X4_50", cv::aruco::DICT_4X4_50},
    {"4X4_100", cv::aruco::DICT_4X4_100},
    {"4X4_250", cv::aruco::DICT_4X4_250},
    {"4X4_1000", cv::aruco::DICT_4X4_1000},
    {"5X5_50", cv::aruco::DICT_5X5_50},
    {"5X5_100", cv::aruco::DICT_5X5_100},
    {"5X5_250", cv::aruco::DICT_5X5_250},
    {"5X5_1000", cv::aruco::DICT_5X5_1000},
    {"6X6_50", cv::aruco::DICT_6X6_50},
    {"6X6_100", cv::aruco::DICT_6X6_100},
    {"6X6_250", cv::aruco::DICT_6X6_250},
    {"6X6_1000", cv::aruco::DICT_6X6_1000},
    {"7X7_50", cv::aruco::DICT_7X7_50},
    {"7X7_100", cv::aruco::DICT_7X7_100},
    {"7X7_250", cv::aruco::DICT_7X7_250},
    {"7X7_1000", cv::aruco::DICT_7X7_1000},
    {"ARUCO_ORIGINAL", cv::aruco::DICT_ARUCO_ORIGINAL},
    {"APRILTAG_16h5", cv::aruco::DICT_APRILTAG_16h5},
    {"APRILTAG_25h9", cv::aruco::DICT_APRILTAG_25h9},
    {"APRILTAG_36h10", cv::aruco::DICT_APRILTAG_36h10},
    {"APRILTAG_36h11", cv::aruco::DICT_APRILTAG_36h11}};

std::vector<std::string> Split(const std::string& text) {
  std::vector<std::string> parts;
  std::size_t from = 0;
  while (true) {
    const std::size_t to = text.find(':', from);
    parts.push_back(text.substr(from, to == std::string::npos ? to : to - from));
    if (to == std::string::npos) return parts;
    from = to + 1;
  }
}

/// A number and what follows it; NaN if there is none.
double NumberIn(const std::string& text, std::string& unit) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (end == text.c_str()) return std::nan("");
  unit = end;
  return value;
}

double LengthIn(const std::string& text, const std::string& board) {
  std::string unit;
  double length = NumberIn(text, unit);
  Require(std::isfinite(length) && (unit.empty() || unit == "m" || unit == "mm"),
          "target '" + board + "': '" + text + "' is no length; write 25mm or 0.025 (metres)");
  if (unit == "mm") length *= 0.001;
  Require(length > 1e-4 && length < 1,
          "target '" + board + "': '" + text +
              "' is not 0.1 to 1000 mm; a number without unit is metres");
  return length;
}

void ReadCounts(const std::string& text, const std::string& board, int least, Board& result) {
  int length = 0;
  const int read = std::sscanf(text.c_str(), "%dx%d%n", &result.columns, &result.rows, &length);
  Require(read == 2 && static_cast<std::size_t>(length) == text.size() &&
              result.columns >= least && result.rows >= least && result.columns <= 100 &&
              result.rows <= 100 && result.columns * result.rows <= 2500,
          "target '" + board + "': '" + text + "' must be COLUMNSxROWS, " + std::to_string(least) +
              " to 100 each");
}

void RequireEnoughMarkers(const Board& board, const std::string& text) {
  const auto dictionary = cv::aruco::getPredefinedDictionary(DictionaryNumber(board));
  const int wanted = static_cast<int>(BoardMarkers(board).size());
  Require(wanted <= dictionary->bytesList.rows,
          "target '" + text + "': has " + std::to_string(wanted) + " markers, dictionary " +
              board.dictionary + " only " + std::to_string(dictionary->bytesList.rows));
}

std::string Millimetres(double length_m) {
  char text[40];
  std::snprintf(text, sizeof text, "%.10gmm", 1000 * length_m);
  return text;
}

}  // namespace

int DictionaryNumber(const Board& board) {
  for (const DictionaryName& d : kDictionaries) {
    if (board.dictionary == d.name) return d.number;
  }
  std::string names;
  for (const DictionaryName& d : kDictionaries)
    names += std::string(names.empty() ? "" : ", ") + d.name;
  throw Error("there is no dictionary '" + board.dictionary + "'; OpenCV has " + names);
}

bool IsWhite(const Board& board, int column, int row) {
  return (column + row) % 2 == (board.legacy ? 0 : 1);
}

int BorderCells(const Board& board) { return board.kind == BoardKind::kAprilGrid ? 2 : 1; }

Board ParseBoard(const std::string& text) {
  const std::vector<std::string> parts = Split(text);
  Board board;
  if (parts[0] == "chessboard" && parts.size() == 3) {
    ReadCounts(parts[1], text, 3, board);
    board.size_m = LengthIn(parts[2], text);
    return board;
  }
  const bool legacy = parts.size() == 6 && parts[5] == "legacy";
  if (parts[0] == "charuco" && (parts.size() == 4 || parts.size() == 5 || legacy)) {
    board.kind = BoardKind::kCharuco;
    ReadCounts(parts[1], text, 3, board);
    board.size_m = LengthIn(parts[2], text);
    board.marker_m = LengthIn(parts[3], text);
    Require(board.marker_m < board.size_m,
            "target '" + text + "': a marker must be smaller than a square");
    board.dictionary = parts.size() >= 5 ? parts[4] : "5X5_250";
    board.legacy = legacy;
    Require(!legacy || board.rows % 2 == 0,
            "target '" + text + "': boards with an odd number of rows are not legacy");
    if (board.dictionary.starts_with("DICT_")) board.dictionary.erase(0, 5);
    RequireEnoughMarkers(board, text);
    return board;
  }
  if (parts[0] == "aprilgrid" && parts.size() == 4) {
    board.kind = BoardKind::kAprilGrid;
    ReadCounts(parts[1], text, 1, board);
    board.size_m = LengthIn(parts[2], text);
    std::string rest;
    const double spacing = NumberIn(parts[3], rest);
    Require(spacing >= 0.05 && spacing <= 1 && rest.empty(),
            "target '" + text +
              "': the spacing is the gap between tags over their edge, 0.05 to 1");
    board.gap_m = spacing * board.size_m;
    board.dictionary = "APRILTAG_36h11";
    RequireEnoughMarkers(board, text);
    return board;
  }
  throw Error("target '" + text +
              "': give chessboard:COLUMNSxROWS:SQUARE (inner corners), "
              "charuco:COLUMNSxROWS:SQUARE:MARKER[:DICTIONARY[:legacy]] (squares) or "
              "aprilgrid:COLUMNSxROWS:TAG:SPACING (tags), such as chessboard:9x6:25mm");
}

std::string FormatBoard(const Board& board) {
  const std::string counts = std::to_string(board.columns) + "x" + std::to_string(board.rows) +
                             ":" + Millimetres(board.size_m);
  if (board.kind == BoardKind::kChessboard) return "chessboard:" + counts;
  if (board.kind == BoardKind::kCharuco)
    return "charuco:" + counts + ":" + Millimetres(board.marker_m) + ":" + board.dictionary +
           (board.legacy ? ":legacy" : "");
  char spacing[40];
  std::snprintf(spacing, sizeof spacing, "%.10g", board.gap_m / board.size_m);
  return "aprilgrid:" + counts + ":" + spacing;
}

int CornersInRow(const Board& board) {
  switch (board.kind) {
    case BoardKind::kChessboard: return board.columns;
    case BoardKind::kCharuco: return board.columns - 1;
    case BoardKind::kAprilGrid: return 2 * board.columns;
  }
  return 0;
}

std::vector<Eigen::Vector3d> BoardCorners(const Board& board) {
  std::vector<Eigen::Vector3d> corners;
  if (board.kind == BoardKind::kAprilGrid) {
    const double pitch = board.size_m + board.gap_m;
    for (int y = 0; y < 2 * board.rows; ++y) {
      for (int x = 0; x < 2 * board.columns; ++x)
        corners.emplace_back(x / 2 * pitch + x % 2 * board.size_m,
                             y / 2 * pitch + y % 2 * board.size_m, 0);
    }
    return corners;
  }
  const bool charuco = board.kind == BoardKind::kCharuco;
  const int first = charuco ? 1 : 0;
  const int columns = board.columns - first, rows = board.rows - first;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x)
      corners.emplace_back((x + first) * board.size_m, (y + first) * board.size_m, 0);
  }
  return corners;
}

std::vector<BoardMarker> BoardMarkers(const Board& board) {
  std::vector<BoardMarker> markers;
  // (right, down) points to the marker's lower right in OpenCV's picture of it.
  const auto add = [&](const Eigen::Vector2d& centre, double half, double right, double down) {
    markers.push_back({static_cast<int>(markers.size()),
                       {centre + half * Eigen::Vector2d(-right, -down),
                        centre + half * Eigen::Vector2d(right, -down),
                        centre + half * Eigen::Vector2d(right, down),
                        centre + half * Eigen::Vector2d(-right, down)}});
  };
  for (int y = 0; y < board.rows; ++y) {
    for (int x = 0; x < board.columns; ++x) {
      const Eigen::Vector2d place(x, y);
      if (board.kind == BoardKind::kAprilGrid) {
        // y runs up, and the tag stands upside down.
        add((place * (board.size_m + board.gap_m)).array() + 0.5 * board.size_m,
            0.5 * board.size_m, -1, 1);
      } else if (board.kind == BoardKind::kCharuco && IsWhite(board, x, y)) {
        add((place.array() + 0.5) * board.size_m, 0.5 * board.marker_m, 1, 1);
      }
    }
  }
  return markers;
}

MarkerCells CellsOf(const Board& board, int id) {
  const auto dictionary = cv::aruco::getPredefinedDictionary(DictionaryNumber(board));
  Require(id >= 0 && id < dictionary->bytesList.rows, "no marker " + std::to_string(id));
  const int bits = dictionary->markerSize, border = BorderCells(board);
  const cv::Mat inner =
      cv::aruco::Dictionary::getBitsFromByteList(dictionary->bytesList.row(id), bits);
  MarkerCells cells;
  cells.side = bits + 2 * border;
  cells.white.assign(static_cast<std::size_t>(cells.side * cells.side), 0);
  for (int y = 0; y < bits; ++y) {
    for (int x = 0; x < bits; ++x)
      cells.white[static_cast<std::size_t>((y + border) * cells.side + x + border)] =
          inner.at<unsigned char>(y, x) != 0;
  }
  if (board.kind == BoardKind::kAprilGrid) std::reverse(cells.white.begin(), cells.white.end());
  return cells;
}

}  // namespace sole::calib
