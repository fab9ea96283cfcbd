#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace sole::io {

/// A page to be printed true to scale, in metres from its upper left corner, y down. Everything is
/// black on white.
struct PrintRect {
  double x_m = 0, y_m = 0, width_m = 0, height_m = 0;
};
struct PrintText {
  double x_m = 0, y_m = 0;  ///< left end of the baseline
  double size_m = 0;        ///< height of the letters' body
  std::string text;
};
struct PrintSheet {
  double width_m = 0, height_m = 0;
  std::vector<PrintRect> rects;
  std::vector<PrintText> texts;
};

/// One SVG file for one page; its numbers are millimetres.
void WriteSvg(const std::filesystem::path& path, const PrintSheet& sheet);

/// One PDF with a page for each sheet, of the sheet's size.
void WritePdf(const std::filesystem::path& path, std::span<const PrintSheet> sheets);

}  // namespace sole::io
