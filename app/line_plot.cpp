#include "app/line_plot.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace sole::app {
namespace {

constexpr double kLeft = 60, kRight = 20, kTop = 36, kBottom = 44, kWidth = 560, kHeight = 300;
constexpr const char* kColours[] = {"#1f6fb4", "#d1632b", "#3a8f4d", "#8a4fa3", "#6b6b6b"};

std::string Escaped(const std::string& text) {
  std::string result;
  for (const char c : text)
    result += c == '<' ? "&lt;" : c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
  return result;
}

std::string Text(double x, double y, const char* anchor, const std::string& text) {
  return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\">{}</text>", x, y, anchor,
                     Escaped(text));
}

/// A round step that divides `range` into at most six parts.
double Step(double range) {
  const double power = std::pow(10, std::floor(std::log10(range / 6)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (range / (factor * power) <= 6) return factor * power;
  }
  return 10 * power;
}

}  // namespace

std::string DrawLinePlot(const LinePlot& plot) {
  double low = INFINITY, high = -INFINITY, top = 0;
  for (const PlotLine& line : plot.lines) {
    for (std::size_t i = 0; i < std::min(line.x.size(), line.y.size()); ++i) {
      if (!std::isfinite(line.x[i]) || !std::isfinite(line.y[i])) continue;
      low = std::min(low, line.x[i]);
      high = std::max(high, line.x[i]);
      top = std::max(top, line.y[i]);
    }
  }
  if (!(low < high)) high = (low = std::isfinite(low) ? low : 0) + 1;
  if (!(top > 0)) top = 1;
  const double step = Step(top);
  top = step * std::ceil(top / step);
  const auto px = [&](double x) {
    return kLeft + (kWidth - kLeft - kRight) * (x - low) / (high - low);
  };
  const auto py = [&](double y) { return kHeight - kBottom - (kHeight - kTop - kBottom) * y / top; };
  std::string svg = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} "
      "{1}\" font-family=\"sans-serif\" font-size=\"12\">",
      kWidth, kHeight);
  svg += Text(kLeft, 18, "start", plot.title) + Text(kWidth / 2, kHeight - 8, "middle", plot.x_label);
  for (double y = 0; y <= top * 1.0001; y += step) {
    svg += fmt::format("<path d=\"M{:.1f} {:.1f}H{:.1f}\" stroke=\"#ddd\"/>", kLeft, py(y),
                       kWidth - kRight);
    svg += Text(kLeft - 6, py(y) + 4, "end", fmt::format("{:.4g}", y));
  }
  svg += Text(kLeft - 6, kTop - 10, "end", plot.y_label);
  const double across = Step(high - low);
  for (double x = across * std::ceil(low / across); x <= high + across * 1e-9; x += across)
    svg += Text(px(x), kHeight - kBottom + 16, "middle", fmt::format("{:.4g}", x));
  for (std::size_t k = 0; k < plot.lines.size(); ++k) {
    const PlotLine& line = plot.lines[k];
    const char* colour = kColours[k % std::size(kColours)];
    std::string points;
    for (std::size_t i = 0; i < std::min(line.x.size(), line.y.size()); ++i) {
      if (std::isfinite(line.x[i]) && std::isfinite(line.y[i]))
        points += fmt::format("{:.1f},{:.1f} ", px(line.x[i]), py(line.y[i]));
    }
    svg += fmt::format(
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\"/>", points, colour);
    if (line.name.empty()) continue;
    const double y = kTop + 14 * static_cast<double>(k);
    svg += fmt::format("<path d=\"M{} {}h18\" stroke=\"{}\" stroke-width=\"2\"/>", kWidth - 150,
                       y - 4, colour);
    svg += Text(kWidth - 126, y, "start", line.name);
  }
  return svg + "</svg>";
}

}  // namespace sole::app
