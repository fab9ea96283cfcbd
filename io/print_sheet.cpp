#include "io/print_sheet.h"

#include <memory>

#include <cairo-pdf.h>
#include <fmt/format.h>

#include "core/error.h"
#include "io/atomic_file.h"

namespace sole::io {
namespace {

constexpr double kPointsPerMetre = 72 / 0.0254;

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '<') escaped += "&lt;";
    else if (c == '>') escaped += "&gt;";
    else if (c == '&') escaped += "&amp;";
    else escaped += c;
  }
  return escaped;
}

/// To a hundredth of a micrometre.
std::string Mm(double length_m) { return fmt::format("{:.5f}", 1000 * length_m); }

cairo_status_t Append(void* text, const unsigned char* data, unsigned length) {
  static_cast<std::string*>(text)->append(reinterpret_cast<const char*>(data), length);
  return CAIRO_STATUS_SUCCESS;
}

void DrawSheet(cairo_t* cairo, const PrintSheet& sheet) {
  cairo_set_source_rgb(cairo, 0, 0, 0);
  // One path, so that no hairline shows between rectangles that touch.
  for (const PrintRect& r : sheet.rects) {
    cairo_rectangle(cairo, kPointsPerMetre * r.x_m, kPointsPerMetre * r.y_m,
                    kPointsPerMetre * r.width_m, kPointsPerMetre * r.height_m);
  }
  cairo_fill(cairo);
  cairo_select_font_face(cairo, "sans-serif", CAIRO_FONT_SLANT_NORMAL, CAIRO_FONT_WEIGHT_NORMAL);
  for (const PrintText& t : sheet.texts) {
    cairo_set_font_size(cairo, kPointsPerMetre * t.size_m);
    cairo_move_to(cairo, kPointsPerMetre * t.x_m, kPointsPerMetre * t.y_m);
    cairo_show_text(cairo, t.text.c_str());
  }
}

}  // namespace

void WriteSvg(const std::filesystem::path& path, const PrintSheet& sheet) {
  std::string svg = fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}mm\" height=\"{1}mm\" "
      "viewBox=\"0 0 {0} {1}\">\n<rect width=\"{0}\" height=\"{1}\" fill=\"white\"/>\n<path d=\"",
      Mm(sheet.width_m), Mm(sheet.height_m));
  for (const PrintRect& r : sheet.rects) {
    svg += fmt::format("M{} {}H{}V{}H{}Z\n", Mm(r.x_m), Mm(r.y_m), Mm(r.x_m + r.width_m),
                       Mm(r.y_m + r.height_m), Mm(r.x_m));
  }
  svg += "\" fill=\"black\"/>\n";
  for (const PrintText& t : sheet.texts) {
    svg += fmt::format("<text x=\"{}\" y=\"{}\" font-size=\"{}\" font-family=\"sans-serif\">"
                       "{}</text>\n",
                       Mm(t.x_m), Mm(t.y_m), Mm(t.size_m), Escaped(t.text));
  }
  WriteStringAtomically(path, svg + "</svg>\n");
}

void WritePdf(const std::filesystem::path& path, std::span<const PrintSheet> sheets) {
  Require(!sheets.empty(), path.string() + ": there is no page to write");
  std::string pdf;
  const std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)> surface(
      cairo_pdf_surface_create_for_stream(Append, &pdf, 1, 1), cairo_surface_destroy);
  const std::unique_ptr<cairo_t, decltype(&cairo_destroy)> cairo(cairo_create(surface.get()),
                                                                 cairo_destroy);
  for (const PrintSheet& sheet : sheets) {
    cairo_pdf_surface_set_size(surface.get(), kPointsPerMetre * sheet.width_m,
                               kPointsPerMetre * sheet.height_m);
    DrawSheet(cairo.get(), sheet);
    cairo_show_page(cairo.get());
  }
  cairo_surface_finish(surface.get());
  const cairo_status_t status = cairo_surface_status(surface.get());
  Require(status == CAIRO_STATUS_SUCCESS,
          path.string() + ": cannot draw the pages: " + cairo_status_to_string(status));
  WriteStringAtomically(path, pdf);
}

}  // namespace sole::io
