#include "recon/match_pair.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/error.h"
#include "recon/grid_match.h"
#include "recon/rectify.h"

namespace sole::recon {
namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();

SubsetOptions SubsetFor(const MatchPairOptions& options) {
  Require(options.window_px % 2 == 1 && options.window_px >= 5 && options.window_px <= 31,
          "window must be an odd number of pixels from 5 to 31, not " +
              std::to_string(options.window_px));
  SubsetOptions subset = options.subset;
  subset.radius_px = options.window_px / 2;
  return subset;
}

/// The curvature of the warp is taken over about ten pixels, whatever the step.
GridOptions GridFor(int step_px) {
  Require(step_px >= 1 && step_px <= 64,
          "step must be 1 to 64 pixels, not " + std::to_string(step_px));
  GridOptions grid;
  grid.step_px = step_px;
  grid.curvature_reach = std::max(2, 10 / step_px);
  return grid;
}

ImageU8 Rounded(const ImageF& image) {
  ImageU8 result(image.width, image.height);
  std::transform(image.pixels.begin(), image.pixels.end(), result.pixels.begin(), [](float value) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0F, 255.0F)));
  });
  return result;
}

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Matches by grid position; null where there is none.
class MatchTable {
 public:
  MatchTable(const std::vector<PixelMatch>& matches, int width, int height, int step_px)
      : step_px_(step_px),
        cols_((width - 1) / step_px + 1),
        rows_((height - 1) / step_px + 1),
        cells_(static_cast<std::size_t>(cols_) * static_cast<std::size_t>(rows_)) {
    for (const PixelMatch& match : matches) {
      cells_[Index(match.left_px.x() / step_px, match.left_px.y() / step_px)] = &match;
    }
  }

  /// Grid position (column, row); null outside.
  const PixelMatch* At(int col, int row) const {
    if (col < 0 || row < 0 || col >= cols_ || row >= rows_) return nullptr;
    return cells_[Index(col, row)];
  }

  /// The match nearest to a left pixel, within `reach` grid steps.
  const PixelMatch* Nearest(const Eigen::Vector2d& px, int reach) const {
    const auto col = static_cast<int>(std::lround(px.x() / step_px_));
    const auto row = static_cast<int>(std::lround(px.y() / step_px_));
    const PixelMatch* best = nullptr;
    double distance = 0;
    for (int y = row - reach; y <= row + reach; ++y) {
      for (int x = col - reach; x <= col + reach; ++x) {
        const PixelMatch* match = At(x, y);
        if (match == nullptr) continue;
        const double d = (match->left_px.cast<double>() - px).squaredNorm();
        if (best != nullptr && d >= distance) continue;
        best = match;
        distance = d;
      }
    }
    return best;
  }

 private:
  std::size_t Index(int col, int row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(cols_) +
           static_cast<std::size_t>(col);
  }

  int step_px_, cols_, rows_;
  std::vector<const PixelMatch*> cells_;
};

/// Disparity that a match's warp gives a pixel near its own.
double DisparityAt(const PixelMatch& match, const Eigen::Vector2d& px) {
  return px.x() - match.match.warp(px - match.left_px.cast<double>()).x();
}

/// Disparity of a pixel: the warps of its cell's corners, weighted bilinearly.
float Blend(const MatchTable& table, int x, int y, int step, double max_spread_px) {
  const int col = x / step, row = y / step;
  const double fx = static_cast<double>(x % step) / step, fy = static_cast<double>(y % step) / step;
  const std::array<double, 4> weights{(1 - fx) * (1 - fy), fx * (1 - fy), (1 - fx) * fy, fx * fy};
  const Eigen::Vector2d px(x, y);
  double sum = 0, low = std::numeric_limits<double>::infinity(), high = -low;
  for (int k = 0; k < 4; ++k) {
    const double weight = weights[static_cast<std::size_t>(k)];
    if (weight == 0) continue;
    const PixelMatch* match = table.At(col + k % 2, row + k / 2);
    if (match == nullptr) return kNone;
    const double d = DisparityAt(*match, px);
    low = std::min(low, d);
    high = std::max(high, d);
    sum += weight * d;
  }
  return high - low <= max_spread_px ? static_cast<float>(sum) : kNone;
}

void FillStatistics(const std::vector<PixelMatch>& matches, DisparityMap& map) {
  std::vector<double> rows, sigmas;
  for (const PixelMatch& m : matches) {
    rows.push_back(m.match.warp.position_px.y() - m.left_px.y());
    sigmas.push_back(std::sqrt(m.match.covariance_px2(0, 0)));
    map.mean_zncc += m.match.zncc / static_cast<double>(matches.size());
  }
  map.median_sigma_px = Median(std::move(sigmas));
  map.median_row_px = Median(rows);
  for (double& row : rows) row = std::abs(row - map.median_row_px);
  map.row_spread_px = 1.4826 * Median(std::move(rows));
}

const char* Describe(SubsetStatus status) {
  switch (status) {
    case SubsetStatus::kMatched: return "";
    case SubsetStatus::kOutside: return "window leaves an image";
    case SubsetStatus::kFlat: return "no texture";
    case SubsetStatus::kDiverged: return "did not converge";
    case SubsetStatus::kPoor: return "low correlation";
    case SubsetStatus::kUncertain: return "uncertain";
  }
  return "";
}

void CheckSize(const ImageF& image, const Camera& camera) {
  Require(image.width == camera.width && image.height == camera.height,
          "the image of camera " + camera.serial + " is " + std::to_string(image.width) + " x " +
              std::to_string(image.height) + " pixels, the calibration says " +
              std::to_string(camera.width) + " x " + std::to_string(camera.height) +
              ": use the images that belong to the calibration");
}

}  // namespace

DisparityMap MatchRectified(const ImageF& left, const ImageF& right,
                            const MatchPairOptions& options) {
  Require(left.width == right.width && left.height == right.height,
          "the left image is " + std::to_string(left.width) + " x " + std::to_string(left.height) +
              " pixels, the right one " + std::to_string(right.width) + " x " +
              std::to_string(right.height) + ": a rectified pair has images of one size");
  const SubsetOptions subset = SubsetFor(options);
  const GridOptions grid = GridFor(options.step_px);
  Require(options.disparities >= 0, "the number of disparities must not be negative");
  const int wanted = options.disparities > 0 ? options.disparities : left.width / 4;
  const int disparities = std::max(16, (wanted + 15) / 16 * 16);
  Require(disparities <= 4096 && std::abs(options.min_disparity) <= 8192,
          "disparities beyond 4096 are not searched: reduce the images or the range");
  const ImageF start = SemiGlobalDisparity(Rounded(left), Rounded(right), options.min_disparity,
                                           disparities, options.semi_global);
  std::vector<PixelMatch> matches =
      MatchOnGrid(Prepare(left), Prepare(right), ImageU8(left.width, left.height, 255),
                  StartsFromDisparity(start, grid.plane_radius_px), grid, subset)
          .matches;
  std::erase_if(matches, [&](const PixelMatch& m) {
    return std::abs(m.match.warp.position_px.y() - m.left_px.y()) > options.max_row_px;
  });
  DisparityMap map;
  map.disparity = ImageF(left.width, left.height, kNone);
  const MatchTable table(matches, left.width, left.height, options.step_px);
  tbb::parallel_for(0, left.height, [&](int y) {
    for (int x = 0; x < left.width; ++x) {
      map.disparity.At(x, y) = Blend(table, x, y, options.step_px, grid.agreement_px);
    }
  });
  const auto known = std::count_if(map.disparity.pixels.begin(), map.disparity.pixels.end(),
                                   [](float d) { return std::isfinite(d); });
  map.coverage = static_cast<double>(known) / static_cast<double>(map.disparity.pixels.size());
  FillStatistics(matches, map);
  return map;
}

std::vector<PointMatch> MatchPoints(const ImageF& left, const ImageF& right, const Rig& rig,
                                    int pair, std::span<const Eigen::Vector2d> points,
                                    const MatchPairOptions& options) {
  Require(pair >= 0 && pair < static_cast<int>(rig.pairs.size()),
          "the calibration has no such pair");
  const StereoPair& names = rig.pairs[static_cast<std::size_t>(pair)];
  const Camera& camera_left = rig.cameras[static_cast<std::size_t>(names.left)];
  const Camera& camera_right = rig.cameras[static_cast<std::size_t>(names.right)];
  CheckSize(left, camera_left);
  CheckSize(right, camera_right);
  const SubsetOptions subset = SubsetFor(options);
  constexpr int kStep = 5, kReach = 3;
  const Rectification rectification = Rectify(rig, names);
  const ImageF start =
      InitialDisparity(Rounded(left), Rounded(right), rectification, options.semi_global);
  const PreparedImage prepared_left = Prepare(left), prepared_right = Prepare(right);
  const ImageU8 everywhere(left.width, left.height, 255);
  const GridMatches grid = MatchOnGrid(prepared_left, prepared_right, everywhere, rectification,
                                       start, GridFor(kStep), subset);
  const MatchTable table(grid.matches, left.width, left.height, kStep);

  std::vector<PointMatch> results(points.size());
  tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
    PointMatch& result = results[i];
    result.left_px = points[i];
    const PixelMatch* near = table.Nearest(points[i], kReach);
    if (near == nullptr) {
      result.problem = "no match near it";
      return;
    }
    const Eigen::Vector2i pixel = points[i].array().round().matrix().cast<int>();
    SubsetWarp warp = near->match.warp;
    const Eigen::Vector2d offset = (pixel - near->left_px).cast<double>();
    warp.position_px = warp(offset);
    const SubsetMatch match =
        MatchSubset(prepared_left, prepared_right, nullptr, pixel, warp, subset);
    result.problem = Describe(match.status);
    if (!result.problem.empty()) return;
    result.right_px = match.warp(points[i] - pixel.cast<double>());
    result.covariance_px2 = match.covariance_px2;
    if (!warp.curvature.isZero()) result.covariance_px2 *= kCurvatureVarianceFactor;
    result.zncc = match.zncc;
    const Ray a = RayFromPixel(camera_left, rig.plate, result.left_px);
    const Ray b = RayFromPixel(camera_right, rig.plate, result.right_px);
    const RayIntersection crossing = IntersectRays(a, b);
    result.point_m = crossing.point;
    const double depth_m = a.direction.dot(result.point_m - a.origin);
    result.gap_px = crossing.gap_m / depth_m * camera_left.intrinsics[0];
  });
  return results;
}

}  // namespace sole::recon
