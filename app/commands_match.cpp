#include <array>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/console.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/calibration_file.h"
#include "io/image_file.h"
#include "io/pixel_list.h"
#include "recon/match_pair.h"

namespace sole::app {
namespace {

using nlohmann::json;

struct MatchArguments {
  std::string left, right, out, calibration, points, pair;
  recon::MatchPairOptions options;
};

/// Both images with grey levels from 0 to 255.
std::array<ImageF, 2> ReadPair(const MatchArguments& a) {
  std::array<io::GreyImage, 2> images{io::ReadGreyImage(a.left), io::ReadGreyImage(a.right)};
  const auto scale = static_cast<float>(255 / io::WhiteLevel(images));
  for (io::GreyImage& image : images) {
    for (float& level : image.grey.pixels) level *= scale;
  }
  return {std::move(images[0].grey), std::move(images[1].grey)};
}

int FindPair(const Rig& rig, const MatchArguments& a) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < rig.pairs.size(); ++i) {
    if (rig.pairs[i].name == a.pair) return static_cast<int>(i);
    names.push_back(rig.pairs[i].name);
  }
  Require(!rig.pairs.empty(), a.calibration + ": has no stereo pairs");
  if (a.pair.empty() && rig.pairs.size() == 1) return 0;
  throw Error(fmt::format("{}: {}: name one of its pairs with --pair: {}", a.calibration,
                          a.pair.empty() ? "has several pairs" : "has no pair '" + a.pair + "'",
                          fmt::join(names, ", ")));
}

json MatchRectifiedPair(const MatchArguments& a) {
  io::CheckFloatImageExtension(a.out);
  const auto [left, right] = ReadPair(a);
  const recon::DisparityMap map = recon::MatchRectified(left, right, a.options);
  if (std::abs(map.median_row_px) > 0.5 || map.row_spread_px > 0.5) {
    Log(fmt::format("warning: rows of matching points differ by {:.2f} +- {:.2f} px: is the pair rectified?",
                    map.median_row_px, map.row_spread_px));
  }
  io::WriteFloatImage(a.out, map.disparity);
  return {{"coverage", map.coverage},           {"median_sigma_px", map.median_sigma_px},
          {"median_row_px", map.median_row_px}, {"row_spread_px", map.row_spread_px},
          {"mean_zncc", map.mean_zncc}};
}

std::string CsvOf(const std::vector<recon::PointMatch>& matches) {
  std::string csv =
      "x_px,y_px,right_x_px,right_y_px,var_xx_px2,cov_xy_px2,var_yy_px2,zncc,x_m,y_m,z_m,gap_px,problem\n";
  for (const recon::PointMatch& m : matches) {
    csv += fmt::format("{},{},", m.left_px.x(), m.left_px.y());
    if (m.problem.empty()) {
      csv += fmt::format("{:.5f},{:.5f},{:.4e},{:.4e},{:.4e},{:.5f},{:.7f},{:.7f},{:.7f},{:.4f},\n", m.right_px.x(),
                         m.right_px.y(), m.covariance_px2(0, 0), m.covariance_px2(0, 1), m.covariance_px2(1, 1),
                         m.zncc, m.point_m.x(), m.point_m.y(), m.point_m.z(), m.gap_px);
    } else {
      csv += ",,,,,,,,,," + m.problem + "\n";
    }
  }
  return csv;
}

json MatchListedPoints(const MatchArguments& a) {
  Require(std::filesystem::path(a.out).extension() == ".csv",
          a.out + ": matches of listed points are written as .csv");
  const Rig rig = io::ReadCalibration(a.calibration).rig;
  const int pair = FindPair(rig, a);
  const std::vector<Eigen::Vector2d> points = io::ReadPixelList(a.points);
  const auto [left, right] = ReadPair(a);
  const std::vector<recon::PointMatch> matches = recon::MatchPoints(left, right, rig, pair, points, a.options);
  io::WriteStringAtomically(a.out, CsvOf(matches));
  int matched = 0;
  for (const recon::PointMatch& match : matches) matched += match.problem.empty() ? 1 : 0;
  return {{"points", matches.size()}, {"matched", matched}};
}

void MatchCommand(const MatchArguments& a, const CommonOptions& common) {
  const Stopwatch watch;
  json result = a.calibration.empty() ? MatchRectifiedPair(a) : MatchListedPoints(a);
  result["seconds"] = watch.Seconds();
  if (common.json) {
    fmt::print("{}\n", result.dump(2));
  } else if (a.calibration.empty()) {
    fmt::print("{}: disparity of {:.1f} % of the pixels, sigma {:.3f} px, {:.2f} s\n", a.out,
               100 * result["coverage"].get<double>(), result["median_sigma_px"].get<double>(), watch.Seconds());
  } else {
    fmt::print("{}: {} of {} points matched, {:.2f} s\n", a.out, result["matched"].get<int>(),
               result["points"].get<int>(), watch.Seconds());
  }
}

}  // namespace

void AddMatchCommand(CLI::App& app, CommonOptions& common, int& status) {
  const auto a = std::make_shared<MatchArguments>();
  CLI::App* match = app.add_subcommand(
      "match",
      "Sub-pixel matches of one stereo pair from anywhere: the disparity of a rectified pair (needs nothing else), or "
      "with --calibration and --points the matches of listed points of a raw pair");
  match->footer(
      "Example: sole match left.png right.png --out disparity.tiff\n"
      "         sole match left.png right.png --calibration rig-calibration.json --points points.csv --out matches.csv\n"
      "Images: PNG, TIFF or PFM, 8 or 16 bit (also 10, 12 and 14 bit in 16) or floating point. docs/formats.md says "
      "what the results hold.");
  match->add_option("LEFT", a->left, "Left image")->required();
  match->add_option("RIGHT", a->right, "Right image, of the same size")->required();
  match->add_option("--out", a->out, "Disparity as .tiff or .pfm (32-bit float), or matches as .csv")->required();
  CLI::Option* calibration = match->add_option("--calibration", a->calibration, "Calibration of a raw pair");
  CLI::Option* points = match->add_option("--points", a->points, "CSV of left pixels with the header x_px,y_px");
  calibration->needs(points);
  points->needs(calibration);
  match->add_option("--pair", a->pair, "Name of the pair in the calibration, where it has several")->needs(calibration);
  match->add_option("--min-disparity", a->options.min_disparity, "Smallest left x minus right x, px (default 0)")
      ->excludes(calibration);
  match->add_option("--disparities", a->options.disparities, "Range of disparities, px (default: a quarter of the width)")
      ->check(CLI::Range(1, 4096))
      ->excludes(calibration);
  match->add_option("--window", a->options.window_px, "Edge of the matched window, odd (default 15)")
      ->check(CLI::Range(5, 31));
  match->add_option("--step", a->options.step_px, "Pixels between refined points (default 2)")
      ->check(CLI::Range(1, 64))
      ->excludes(calibration);
  match->callback([a, &common, &status] {
    const ThreadCap cap(common.threads);
    MatchCommand(*a, common);
    status = 0;
  });
}

}  // namespace sole::app
