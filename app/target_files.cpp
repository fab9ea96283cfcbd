#include "app/target_files.h"

#include <fmt/format.h>

#include "calib/targets.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/mesh_file.h"

namespace sole::app {
namespace {

using nlohmann::json;

json ListOf(const auto& vector) {
  json list = json::array();
  for (const double value : vector) list.push_back(value);
  return list;
}

json PageJson(const calib::PrintedSheet& sheet) {
  json corners = json::array();
  for (const calib::PrintedCorner& corner : sheet.corners) {
    corners.push_back({{"id", corner.id}, {"page_m", ListOf(corner.page_m)}, {"target_m", ListOf(corner.target_m)}});
  }
  return {{"name", sheet.name}, {"width_m", sheet.page.width_m}, {"height_m", sheet.page.height_m},
          {"scale_bar", {{"from_m", ListOf(sheet.bar_from_m)}, {"to_m", ListOf(sheet.bar_to_m)},
                         {"length_m", (sheet.bar_to_m - sheet.bar_from_m).norm()}}},
          {"corners", corners}};
}

}  // namespace

json PrintTarget(const std::string& kind, const RigConfig& rig, const std::filesystem::path& folder, const TargetPrintOptions& options) {
  const TargetConfig& cube = rig.target;
  const bool is_cube = kind == "cube";
  std::vector<calib::PrintedSheet> sheets;
  std::string name = kind, target = kind;
  if (is_cube) {
    sheets = calib::DrawCube(cube, options.page);
    Require(options.paper_thickness_m >= 0 && options.paper_thickness_m < 0.1 * cube.edge_m,
            "the paper's thickness must be 0 or more, and small beside the cube");
  } else if (kind == "sheet") {
    sheets = calib::DrawContactSheet(rig.sheet, options.page);
  } else {
    const calib::Board board = calib::ParseBoard(kind);
    target = calib::FormatBoard(board);
    name = fmt::format("{}-{}x{}", kind.substr(0, kind.find(':')), board.columns, board.rows);
    sheets.push_back(calib::DrawBoard(board, options.page));
  }
  io::MakeDirectory(folder);
  std::vector<std::string> files;
  const auto file = [&](const std::string& ending) {
    files.push_back((folder / (name + ending)).string());
    return files.back();
  };
  std::vector<io::PrintSheet> pages;
  json described = json::array();
  for (const calib::PrintedSheet& sheet : sheets) {
    pages.push_back(sheet.page);
    described.push_back(PageJson(sheet));
    io::WriteSvg(file(sheets.size() > 1 ? fmt::format("-{}.svg", pages.size()) : ".svg"), sheet.page);
  }
  io::WritePdf(file(".pdf"), pages);
  json result{{"format", "sole-target"}, {"version", 1}, {"units", "m; page coordinates from the upper left, y down"},
              {"target", target}, {"pages", described}};
  if (kind == "sheet") result["sheet"] = {{"size_x_m", rig.sheet.size_x_m}, {"size_y_m", rig.sheet.size_y_m}};
  if (is_cube) {
    const double body_m = cube.edge_m - 2 * options.paper_thickness_m;
    io::WriteStl(file(".stl"), calib::CubeBody(body_m));
    result["cube"] = {{"edge_m", cube.edge_m}, {"squares", cube.squares}, {"square_m", cube.square_m}, {"marker_m", cube.marker_m},
                      {"body_edge_m", body_m}};
  }
  io::WriteStringAtomically(file(".json"), result.dump(2) + "\n");
  const io::PrintSheet& page = pages.front();
  json account{{"target", target}, {"files", files}, {"pages", pages.size()},
               {"page_mm", fmt::format("{:.6g} x {:.6g}", 1000 * page.width_m, 1000 * page.height_m)},
               {"scale_bar_mm", 100}};
  if (is_cube) account["body_edge_mm"] = 1000 * result["cube"]["body_edge_m"].get<double>();
  return account;
}

}  // namespace sole::app
