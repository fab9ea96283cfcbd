#include "calib/ground.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <set>
#include <utility>

#include "calib/ground_fit_internal.h"
#include "core/error.h"

namespace sole::calib {
namespace {

using Cell = std::pair<int, int>;
using Cells = std::set<Cell>;

Cell CellOf(const Eigen::Vector2d& place_m, double cell_m) {
  return {static_cast<int>(std::floor(place_m.x() / cell_m)),
          static_cast<int>(std::floor(place_m.y() / cell_m))};
}

/// Samples of everything but the etched marks, which lie on the glass and not on the sheet.
std::vector<GroundSample> SamplesOf(const std::vector<SheetPoint>& points, const RigConfig& config,
                              const GroundOptions& options) {
  const auto on_mark = [&](const Eigen::Vector2d& place) {
    return std::any_of(config.plate.fiducials.begin(), config.plate.fiducials.end(),
                       [&](const Fiducial& f) {
                         const Eigen::Vector2d d = (place - f.centre_m).cwiseAbs();
                         return d.maxCoeff() < 0.8 * f.size_m;  // with its white border
                       });
  };
  std::vector<GroundSample> samples;
  for (const SheetPoint& p : points) {
    const Eigen::Vector2d place = p.point_m.head<2>();
    if (!p.point_m.allFinite() || on_mark(place)) continue;
    const double variance = p.sigma_m * p.sigma_m + options.floor_m * options.floor_m;
    samples.push_back({place, p.point_m.z() - (p.from_below ? 0 : config.sheet.thickness_m),
                       1 / variance, p.pair, p.from_below});
  }
  return samples;
}

/// Cells without their outermost ring, where windows reach over the sheet's edge.
Cells Eroded(const Cells& cells) {
  Cells inner;
  for (const Cell& c : cells) {
    bool surrounded = true;
    for (int k = 0; k < 9; ++k)
      surrounded = surrounded && cells.contains({c.first + k % 3 - 1, c.second + k / 3 - 1});
    if (surrounded) inner.insert(c);
  }
  return inner;
}

Cells LargestPiece(Cells cells) {
  Cells largest;
  while (!cells.empty()) {
    Cells piece;
    std::vector<Cell> open{*cells.begin()};
    cells.erase(cells.begin());
    while (!open.empty()) {
      const Cell c = open.back();
      open.pop_back();
      piece.insert(c);
      for (const Cell& step : {Cell{1, 0}, Cell{-1, 0}, Cell{0, 1}, Cell{0, -1}}) {
        const Cell next{c.first + step.first, c.second + step.second};
        if (cells.erase(next) > 0) open.push_back(next);
      }
    }
    if (piece.size() > largest.size()) largest = std::move(piece);
  }
  return largest;
}

/// Cells of the sheet: as full of a pair's points as most of that pair's. Dust leaves few in one.
Cells SheetCells(const std::vector<GroundSample>& samples, const GroundOptions& options) {
  std::map<int, std::map<Cell, int>> counts;
  for (const GroundSample& s : samples) ++counts[s.pair][CellOf(s.place_m, options.cell_m)];
  Cells full;
  for (const auto& [pair, cells] : counts) {
    std::vector<double> fill;
    for (const auto& [cell, count] : cells) fill.push_back(count);
    const double enough = std::max(3.0, 0.5 * Median(fill));
    for (const auto& [cell, count] : cells) {
      if (count >= enough) full.insert(cell);
    }
  }
  return LargestPiece(Eroded(full));
}

/// Plane through most samples: begins at the median height and leaves out what is far from it.
HeightPlane RobustPlane(const std::vector<GroundSample>& samples, const GroundOptions& options) {
  std::vector<double> heights;
  for (const GroundSample& s : samples) heights.push_back(s.height_m);
  HeightPlane plane{Median(std::move(heights)), 0, 0};
  for (const double reach : {8.0, 4.0, 2.0, 1.0}) {
    std::vector<GroundSample> near;
    for (const GroundSample& s : samples) {
      if (std::abs(s.height_m - plane.At(s.place_m)) < reach * options.max_distance_m)
        near.push_back(s);
    }
    if (near.size() < 3) break;
    plane = FitPlane(near);
  }
  return plane;
}

/// Mean of every pair's samples above the surface; their scatter goes into the nodes' sigmas.
std::vector<SheetView> CompareViews(GroundSurface& s, const std::vector<GroundSample>& samples,
                                    const GroundOptions& options) {
  std::map<int, SheetView> views;
  for (const GroundSample& sample : samples) {
    SheetView& view = views[sample.pair];
    view.pair = sample.pair;
    ++view.points;
    view.offset_mm += 1000 * (sample.height_m - HeightAt(s, sample.place_m));
  }
  std::vector<SheetView> result;
  double squares = 0;
  for (auto& [pair, view] : views) {
    view.offset_mm /= view.points;
    squares += view.offset_mm * view.offset_mm;
    result.push_back(view);
  }
  const auto count = static_cast<double>(result.size());
  const double scatter = count > 1 ? 0.001 * std::sqrt(squares / (count - 1)) : 0;
  const double common = std::max(scatter, count > 1 ? 0 : options.pair_sigma_m) / std::sqrt(count);
  for (double& sigma : s.sigma_m) sigma = std::hypot(sigma, common);
  return result;
}

/// Median over cells of how far the heights seen from above and below lie apart; NaN if few cells
/// were seen from both.
double GapBetweenSides(const std::vector<GroundSample>& samples, const GroundOptions& options) {
  constexpr std::size_t kFewest = 20;
  struct Sides {
    double sum[2] = {0, 0};
    int count[2] = {0, 0};
  };
  std::map<Cell, Sides> cells;
  for (const GroundSample& s : samples) {
    Sides& sides = cells[CellOf(s.place_m, options.cell_m)];
    sides.sum[s.from_below] += s.height_m;
    ++sides.count[s.from_below];
  }
  std::vector<double> gaps;
  for (const auto& [cell, sides] : cells) {
    if (sides.count[0] > 0 && sides.count[1] > 0)
      gaps.push_back(sides.sum[0] / sides.count[0] - sides.sum[1] / sides.count[1]);
  }
  return gaps.size() < kFewest ? std::numeric_limits<double>::quiet_NaN() : Median(gaps);
}

/// Sheet less fiducials: in the middle of the grid, and how much that changes towards its corners.
void CompareWithMarks(GroundEstimate& estimate) {
  const GroundSurface& s = estimate.surface;
  if (s.marks.size() < 3) return;
  const HeightPlane marks = PlaneThrough(s.marks);
  const Eigen::Vector2d half =
      0.5 * s.spacing_m * Eigen::Vector2d(s.nodes_x - 1, s.nodes_y - 1);
  const Eigen::Vector2d middle = s.first_node_m + half;
  estimate.shift_mm = 1000 * (s.plane.At(middle) - marks.At(middle));
  estimate.tilt_mm = 1000 * (std::abs(s.plane.slope_x - marks.slope_x) * half.x() +
                             std::abs(s.plane.slope_y - marks.slope_y) * half.y());
}

std::string Text(const char* format, double a, double b) {
  char text[300];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

std::vector<std::string> FailuresOf(const GroundEstimate& estimate, const RigConfig& config,
                                    const GroundOptions& options) {
  std::vector<std::string> failures;
  const double given_mm = 1000 * config.sheet.thickness_m;
  if (std::abs(estimate.thickness_mm - given_mm) > options.max_thickness_mm) {
    failures.push_back(
        Text("the sheet is %.3f mm thick between the cameras above and below, the rig file says "
             "%.3f mm: measure it and correct thickness_m in [sheet], or calibrate again",
             estimate.thickness_mm, given_mm));
  }
  if (std::abs(estimate.shift_mm) > options.max_shift_mm) {
    failures.push_back(
        Text("the sheet lies %.3f mm above the fiducials' plane, limit %.3f mm: lay it flat on "
             "clean glass; are the fiducials etched into the glass top?",
             estimate.shift_mm, options.max_shift_mm));
  }
  if (estimate.tilt_mm > options.max_shift_mm) {
    failures.push_back(
        Text("the sheet is tilted against the fiducials' plane by %.3f mm at its corners, limit "
             "%.3f mm: lay it flat on clean glass",
             estimate.tilt_mm, options.max_shift_mm));
  }
  if (estimate.coverage < options.min_coverage) {
    failures.push_back(Text("%.0f %% of the sheet was seen, needs %.0f %%: lay it in the middle of "
                            "the plate, and see [sheet] in the rig file for its size",
                            100 * estimate.coverage, 100 * options.min_coverage));
  }
  return failures;
}

}  // namespace

GroundEstimate EstimateGround(const std::vector<SheetPoint>& points, const RigConfig& config,
                              const std::vector<GroundMark>& marks, const GroundOptions& options) {
  std::vector<GroundSample> samples = SamplesOf(points, config, options);
  const HeightPlane start = RobustPlane(samples, options);
  std::erase_if(samples, [&](const GroundSample& s) {
    return std::abs(s.height_m - start.At(s.place_m)) > options.max_distance_m;
  });
  const Cells cells = SheetCells(samples, options);
  std::erase_if(samples, [&](const GroundSample& s) {
    return !cells.contains(CellOf(s.place_m, options.cell_m));
  });
  Require(static_cast<int>(samples.size()) >= options.min_points,
          "ground: " + std::to_string(samples.size()) +
              " points of the contact sheet were found, needs " +
              std::to_string(options.min_points) +
              "; lay the speckled sheet flat on the middle of the glass, check light and focus");
  GroundEstimate estimate;
  GroundSurface& surface = estimate.surface;
  estimate.thickness_mm =
      1000 * (GapBetweenSides(samples, options) + config.sheet.thickness_m);
  estimate.rejected = FitGrid(surface, samples, options);
  double squares = 0;
  for (const GroundSample& s : samples)
    squares += std::pow(s.height_m - HeightAt(surface, s.place_m), 2);
  surface.points = static_cast<int>(samples.size());
  surface.rms_m = std::sqrt(squares / surface.points);
  surface.sheet_thickness_m = config.sheet.thickness_m;
  surface.marks = marks;
  estimate.views = CompareViews(surface, samples, options);
  estimate.sigma_mm = 1000 * Median(surface.sigma_m);
  const double area = static_cast<double>(cells.size()) * options.cell_m * options.cell_m;
  estimate.coverage = area / (config.sheet.size_x_m * config.sheet.size_y_m);
  CompareWithMarks(estimate);
  estimate.failures = FailuresOf(estimate, config, options);
  return estimate;
}

}  // namespace sole::calib
