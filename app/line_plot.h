#pragma once

#include <string>
#include <vector>

namespace sole::app {

struct PlotLine {
  std::string name;  ///< in the legend; empty: none
  std::vector<double> x, y;
};

/// Curves over one axis, from y = 0 upwards.
struct LinePlot {
  std::string title, x_label, y_label;
  std::vector<PlotLine> lines;
};

/// The plot as an SVG element for HTML pages; values that are not finite are left out.
std::string DrawLinePlot(const LinePlot& plot);

}  // namespace sole::app
