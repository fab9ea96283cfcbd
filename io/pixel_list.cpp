#include "io/pixel_list.h"

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/csv_internal.h"

namespace sole::io {

std::vector<Eigen::Vector2d> ReadPixelList(const std::filesystem::path& path) {
  const CsvTable table = ParseCsv(ReadFile(path), {"x_px", "y_px"}, path.string());
  Require(!table.rows.empty(), path.string() + ": has no points: one line 'x,y' per left pixel");
  std::vector<Eigen::Vector2d> pixels;
  for (const CsvTable::Row& row : table.rows) {
    pixels.emplace_back(table.Number(row, 0), table.Number(row, 1));
    Require(pixels.back().allFinite() && pixels.back().cwiseAbs().maxCoeff() < 1e6,
            table.Place(row, 0) + ": is not a pixel of an image");
  }
  return pixels;
}

}  // namespace sole::io
