#include "calib/targets.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <random>

#include "calib/boards_internal.h"
#include "core/error.h"
#include "core/target.h"

namespace sole::calib {
namespace {

using Rects = std::vector<io::PrintRect>;

constexpr double kMargin_m = 0.010;
constexpr double kFoot_m = 0.028;  ///< below the content: scale bar and text
constexpr double kBar_m = 0.100;
constexpr double kText_m = 0.003;

/// Content in a frame of its own: y down, origin its upper left corner.
struct Content {
  double width_m = 0, height_m = 0;
  Rects rects;
};

/// Black cells of a marker, runs of a row as one.
void AddMarker(const MarkerCells& cells, double x_m, double y_m, double edge_m, Rects& rects) {
  const double cell = edge_m / cells.side;
  for (int y = 0; y < cells.side; ++y) {
    for (int x = 0; x < cells.side; ++x) {
      int end = x;
      const auto white = [&](int at) {
        return cells.white[static_cast<std::size_t>(y * cells.side + at)] != 0;
      };
      while (end < cells.side && !white(end)) ++end;
      if (end == x) continue;
      rects.push_back({x_m + x * cell, y_m + y * cell, (end - x) * cell, cell});
      x = end;
    }
  }
}

/// Black squares of columns x rows, and markers in the white ones of a ChArUco board.
Content DrawSquares(const Board& board, int first_id) {
  const bool charuco = board.kind == BoardKind::kCharuco;
  const int columns = board.columns + (charuco ? 0 : 1), rows = board.rows + (charuco ? 0 : 1);
  const double s = board.size_m;
  Content content{columns * s, rows * s, {}};
  int id = first_id;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      if (!IsWhite(board, x, y)) {
        content.rects.push_back({x * s, y * s, s, s});
      } else if (charuco) {
        const double in = 0.5 * (s - board.marker_m);
        AddMarker(CellsOf(board, id++), x * s + in, y * s + in, board.marker_m, content.rects);
      }
    }
  }
  return content;
}

Content DrawAprilGrid(const Board& board) {
  const double gap = board.gap_m, pitch = board.size_m + gap;
  Content content{board.columns * pitch + gap, board.rows * pitch + gap, {}};
  for (int y = 0; y <= board.rows; ++y) {
    for (int x = 0; x <= board.columns; ++x)
      content.rects.push_back({x * pitch, y * pitch, gap, gap});
  }
  for (int y = 0; y < board.rows; ++y) {
    for (int x = 0; x < board.columns; ++x) {
      AddMarker(CellsOf(board, y * board.columns + x), x * pitch + gap,
                content.height_m - (y + 1) * pitch, board.size_m, content.rects);
    }
  }
  return content;
}

/// Size of a page by name; empty for auto.
std::optional<Eigen::Vector2d> PageSize(const std::string& page) {
  if (page == "auto") return {};
  double width = 0, height = 0;
  int length = 0;
  if (page.size() == 2 && page[0] == 'A' && page[1] >= '0' && page[1] <= '4') {
    constexpr double kSizes[5][2] = {{841, 1189}, {594, 841}, {420, 594}, {297, 420}, {210, 297}};
    return 0.001 * Eigen::Vector2d(kSizes[page[1] - '0'][0], kSizes[page[1] - '0'][1]);
  }
  Require(std::sscanf(page.c_str(), "%lfx%lf%n", &width, &height, &length) == 2 &&
              static_cast<std::size_t>(length) == page.size() && width > 0 && height > 0 &&
              width <= 5000 && height <= 5000,
          "page '" + page + "': give auto, A4, A3, A2, A1, A0 or WIDTHxHEIGHT in millimetres");
  return Eigen::Vector2d(0.001 * width, 0.001 * height);
}

/// The page, upright or lying, that holds so much; empty if it does not.
std::optional<Eigen::Vector2d> Holding(const Eigen::Vector2d& page, const Eigen::Vector2d& wanted) {
  const Eigen::Vector2d lying(page.y(), page.x());
  if ((wanted.array() <= page.array() + 1e-9).all()) return page;
  if ((wanted.array() <= lying.array() + 1e-9).all()) return lying;
  return {};
}

Eigen::Vector2d ChoosePage(const std::string& page, const Content& content, double margin_m) {
  const Eigen::Vector2d wanted(std::max(content.width_m, kBar_m) + 2 * margin_m,
                               content.height_m + margin_m + kFoot_m);
  if (const auto size = PageSize(page)) {
    const auto held = Holding(*size, wanted);
    char text[120];
    std::snprintf(text, sizeof text, "needs %.0f x %.0f mm with its margins",
                  std::ceil(1000 * wanted.x() - 1e-6), std::ceil(1000 * wanted.y() - 1e-6));
    Require(held.has_value(), "page '" + page + "' is too small: the target " + text);
    return *held;
  }
  for (const char* name : {"A4", "A3", "A2", "A1", "A0"}) {
    if (const auto held = Holding(*PageSize(name), wanted)) return *held;
  }
  return wanted;
}

/// Content in the middle of its page, scale bar and text below; `origin_m` is where the content's
/// upper left corner came to lie.
PrintedSheet Lay(const Content& content, const std::string& page, double margin_m,
                 const std::string& title, Eigen::Vector2d& origin_m) {
  const Eigen::Vector2d size = ChoosePage(page, content, margin_m);
  PrintedSheet sheet;
  sheet.page.width_m = size.x();
  sheet.page.height_m = size.y();
  origin_m = {0.5 * (size.x() - content.width_m),
              margin_m + 0.5 * (size.y() - margin_m - kFoot_m - content.height_m)};
  for (io::PrintRect rect : content.rects) {
    rect.x_m += origin_m.x();
    rect.y_m += origin_m.y();
    sheet.page.rects.push_back(rect);
  }
  const double left = 0.5 * (size.x() - kBar_m), top = size.y() - kFoot_m + 0.010;
  for (const int block : {0, 2, 4})
    sheet.page.rects.push_back({left + 0.2 * block * kBar_m, top, 0.2 * kBar_m, 0.002});
  sheet.bar_from_m = {left, top + 0.001};
  sheet.bar_to_m = {left + kBar_m, top + 0.001};
  sheet.page.texts.push_back({left, top + 0.007, kText_m, title});
  sheet.page.texts.push_back({left, top + 0.0115, kText_m,
                              "Print at 100 %, no fitting to the page: the bar must be 100.0 mm."});
  return sheet;
}

/// Short strokes outside the corners of a rectangle along its edges.
void AddCutMarks(double width_m, double height_m, Rects& rects) {
  constexpr double kThin = 0.0001, kFrom = 0.001, kLong = 0.004;
  for (const double y : {0.0, height_m}) {
    for (const double x : {-kFrom - kLong, width_m + kFrom})
      rects.push_back({x, y - 0.5 * kThin, kLong, kThin});
  }
  for (const double x : {0.0, width_m}) {
    for (const double y : {-kFrom - kLong, height_m + kFrom})
      rects.push_back({x - 0.5 * kThin, y, kThin, kLong});
  }
}

/// "+x" and so on for a direction along an axis.
std::string AxisName(const Eigen::Vector3d& direction) {
  Eigen::Index axis = 0;
  direction.cwiseAbs().maxCoeff(&axis);
  return std::string(direction[axis] < 0 ? "-" : "+") + "xyz"[axis];
}

}  // namespace

PrintedSheet DrawBoard(const Board& board, const std::string& page) {
  const bool grid = board.kind == BoardKind::kAprilGrid;
  const Content content = grid ? DrawAprilGrid(board) : DrawSquares(board, 0);
  Eigen::Vector2d origin;
  PrintedSheet sheet = Lay(content, page, kMargin_m, FormatBoard(board), origin);
  sheet.name = "board";
  const std::vector<Eigen::Vector3d> corners = BoardCorners(board);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Eigen::Vector3d& p = corners[i];
    const double first = board.kind == BoardKind::kChessboard ? board.size_m : 0;
    const Eigen::Vector2d on_page =
        grid ? Eigen::Vector2d(p.x() + board.gap_m, content.height_m - board.gap_m - p.y())
             : Eigen::Vector2d(p.x() + first, p.y() + first);
    sheet.corners.push_back({static_cast<int>(i), origin + on_page, p});
  }
  return sheet;
}

std::vector<PrintedSheet> DrawCube(const TargetConfig& cube, const std::string& page) {
  const CalibrationBody body =
      MakeCalibrationCube(cube.edge_m, cube.squares, cube.square_m, cube.marker_m);
  std::vector<PrintedSheet> sheets;
  int id = 0;
  for (const CharucoFace& face : body.faces) {
    Board board{BoardKind::kCharuco, face.squares_x, face.squares_y, face.square_m,
                face.marker_m,       0,              "5X5_250",       false};
    Content content = DrawSquares(board, face.first_id);
    const Eigen::Vector2d inset(0.5 * (body.edge_m - content.width_m),
                                0.5 * (body.edge_m - content.height_m));
    for (io::PrintRect& rect : content.rects) {
      rect.x_m += inset.x();
      rect.y_m += inset.y();
    }
    content.width_m = content.height_m = body.edge_m;
    AddCutMarks(body.edge_m, body.edge_m, content.rects);
    const Eigen::Matrix3d axes = face.body_from_board.rotation.toRotationMatrix();
    const std::string name = "face " + AxisName(-axes.col(2));
    char sizes[100];
    std::snprintf(sizes, sizeof sizes, ", cube of %.6g mm; right is %s, down is %s",
                  1000 * body.edge_m, AxisName(axes.col(0)).c_str(), AxisName(axes.col(1)).c_str());
    Eigen::Vector2d origin;
    PrintedSheet sheet = Lay(content, page, kMargin_m, name + sizes, origin);
    sheet.name = name;
    for (int corner = 0; corner < (face.squares_x - 1) * (face.squares_y - 1); ++corner) {
      const Eigen::Vector3d in_body = CornerInBody(face, corner);
      const Eigen::Vector2d in_board = (face.body_from_board.Inverse() * in_body).head<2>();
      sheet.corners.push_back({id++, origin + inset + in_board, in_body});
    }
    sheets.push_back(std::move(sheet));
  }
  return sheets;
}

std::vector<PrintedSheet> DrawContactSheet(const SheetConfig& config, const std::string& page) {
  constexpr double kPitch_m = 0.00105;  // dots of four pixels of the default rig, about
  Content content{config.size_x_m, config.size_y_m, {}};
  std::mt19937_64 random(4711);
  std::uniform_real_distribution<double> unit(0, 1);
  const int columns = static_cast<int>(config.size_x_m / kPitch_m),
            rows = static_cast<int>(config.size_y_m / kPitch_m);
  for (int i = 0; i < columns * rows; ++i) {
    if (unit(random) < 0.15) continue;  // gaps make the pattern less regular
    const double edge = kPitch_m * (0.5 + 0.4 * unit(random));
    const auto place = [&](int cell, double extent_m) {
      const double middle = (cell + 0.5 + 0.9 * (unit(random) - 0.5)) * kPitch_m;
      return std::clamp(middle - 0.5 * edge, 0.0, extent_m - edge);
    };
    const double x = place(i % columns, config.size_x_m), y = place(i / columns, config.size_y_m);
    content.rects.push_back({x, y, edge, edge});
  }
  AddCutMarks(config.size_x_m, config.size_y_m, content.rects);
  std::vector<PrintedSheet> sides;
  for (const char* side : {"upper side", "lower side"}) {
    Eigen::Vector2d origin;
    const std::string title = std::string("contact sheet, ") + side +
                              ": print one sheet on both sides; its thickness goes into [sheet]";
    PrintedSheet sheet = Lay(content, page, kMargin_m, title, origin);
    sheet.name = side;
    sides.push_back(std::move(sheet));
  }
  return sides;
}

TriangleMesh CubeBody(double edge_m) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.push_back(0.5 * edge_m *
                            Eigen::Vector3d(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1));
  }
  // Two triangles a side, counter-clockwise seen from outside.
  constexpr int kSides[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& s : kSides) {
    mesh.triangles.emplace_back(s[0], s[1], s[2]);
    mesh.triangles.emplace_back(s[0], s[2], s[3]);
  }
  return mesh;
}

}  // namespace sole::calib
