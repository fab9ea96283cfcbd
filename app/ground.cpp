#include "app/ground.h"

#include <algorithm>
#include <cmath>
#include <ctime>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "app/console.h"
#include "calib/detect.h"
#include "calib/ground.h"
#include "core/error.h"
#include "io/take.h"
#include "recon/grid_match.h"
#include "recon/match.h"
#include "recon/triangulate.h"

namespace sole::app {
namespace {

using nlohmann::json;

/// A flat slab around the glass top, wide enough for a plate that was put in anew.
recon::CaptureVolume SheetVolume(const RigConfig& config) {
  const double x = 0.5 * config.sheet.size_x_m + 0.02, y = 0.5 * config.sheet.size_y_m + 0.02;
  return {{-x, -y, -0.01}, {x, y, 0.01}, 0.01};
}

/// Pixels between matched points for this spacing on the glass.
int StepFor(const Camera& camera, double spacing_m) {
  const double px_per_m = camera.intrinsics[0] / camera.CentreInWorld().norm();
  return std::max(2, static_cast<int>(std::lround(spacing_m * px_per_m)));
}

/// Matches and triangulates what one pair sees of the sheet; says why if that is nothing.
void MatchPair(const Rig& rig, int p, const FrameSet& frame, const recon::CaptureVolume& volume,
               std::vector<calib::SheetPoint>& points) {
  constexpr double kSpacing_m = 0.0015;
  const StereoPair& pair = rig.pairs[static_cast<std::size_t>(p)];
  const Camera& camera = rig.cameras[static_cast<std::size_t>(pair.left)];
  const auto &left = frame.images[static_cast<std::size_t>(pair.left)], &right = frame.images[static_cast<std::size_t>(pair.right)];
  const auto skip = [&](const std::string& why) {
    Log(fmt::format("trigger {}, pair {}: {}", frame.trigger, pair.name, why));
  };
  if (!left || !right) return skip("an image is missing");
  for (const ImageU8* image : {&*left, &*right}) {
    const std::string problem = recon::FindForeground(*image).problem;
    if (!problem.empty()) return skip("an image is " + problem);
  }
  recon::RectifyOptions rectify;
  rectify.volume = volume;
  rectify.mid_height_m = 0;
  const recon::Rectification rectification = recon::Rectify(rig, pair, rectify);
  const ImageF disparity = recon::InitialDisparity(*left, *right, rectification);
  recon::GridOptions grid;
  grid.step_px = StepFor(camera, kSpacing_m);
  const recon::GridMatches matches =
      recon::MatchOnGrid(recon::Prepare(*left), recon::Prepare(*right), ImageU8(left->width, left->height, 255),
                         rectification, disparity, grid);
  recon::TriangulateOptions triangulate;
  triangulate.volume = volume;
  triangulate.max_depth_below_glass_m = -volume.min_m.z();
  const recon::Triangulation found = recon::Triangulate(rig, p, matches.matches, *left, triangulate);
  for (const recon::PairPoint& point : found.points) {
    points.push_back({point.point_m, std::abs(point.to_camera.z()) * point.ray_sigma_m, p,
                      LooksThroughPlate(camera, rig.plate)});
  }
}

json Account(const calib::GroundEstimate& estimate, const Rig& rig) {
  const auto figure = [](double value) { return std::isfinite(value) ? json(value) : json(nullptr); };
  json pairs = json::object();
  for (const calib::SheetView& view : estimate.views) {
    pairs[rig.pairs[static_cast<std::size_t>(view.pair)].name] = {{"points", view.points}, {"offset_mm", view.offset_mm}};
  }
  return {{"rms_mm", 1000 * estimate.surface.rms_m}, {"sigma_mm", estimate.sigma_mm}, {"points", estimate.surface.points},
          {"rejected", estimate.rejected}, {"coverage", estimate.coverage}, {"thickness_mm", figure(estimate.thickness_mm)},
          {"shift_mm", figure(estimate.shift_mm)}, {"tilt_mm", figure(estimate.tilt_mm)},
          {"fiducials", estimate.surface.marks.size()}, {"pairs", pairs}, {"failures", estimate.failures}};
}

}  // namespace

json AddGround(Calibration& calibration, const std::filesystem::path& directory) {
  const io::TakeReader take(directory, Log);
  const RigConfig& config = take.Config();
  const std::string where = directory.string() + ": ";
  Require(calibration.rig.rig_hash == RigIdentityHash(config), where + "was recorded with another rig than the calibration was made for");
  const calib::DetectTarget target = calib::TargetOf(config);
  calib::TakeObservations observations;
  std::vector<calib::SheetPoint> points;
  const auto frames = take.Triggers().size();
  Progress progress("match contact sheet", static_cast<int>(frames));
  for (std::size_t i = 0; i < frames; ++i) {
    const FrameSet frame = take.Read(i);
    observations.frames.push_back(calib::DetectInFrame(frame, config, target));
    for (int p = 0; p < static_cast<int>(calibration.rig.pairs.size()); ++p)
      MatchPair(calibration.rig, p, frame, SheetVolume(config), points);
    progress.Set(static_cast<int>(i) + 1);
  }
  const std::vector<GroundMark> marks = calib::MeasureMarks(calibration.rig, config, observations);
  if (marks.size() < 3) {
    Log(fmt::format("{}{} fiducials are seen beside the sheet: later takes cannot tell whether the glass moved", where, marks.size()));
  }
  calib::GroundEstimate estimate;
  try {
    estimate = calib::EstimateGround(points, config, marks);
  } catch (const Error& error) {
    throw Error(where + error.what());
  }
  for (const std::string& failure : estimate.failures) Log("FAILS: " + failure);
  Require(estimate.failures.empty(), where + "no ground was written: " + (estimate.failures.empty() ? "" : estimate.failures.front()));
  estimate.surface.created = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  calibration.ground = estimate.surface;
  return Account(estimate, calibration.rig);
}

json CompareGround(const Calibration& calibration, const RigConfig& config, const calib::TakeObservations& observations) {
  if (!calibration.ground) return nullptr;
  const std::vector<GroundMark> marks = calib::MeasureMarks(calibration.rig, config, observations);
  if (marks.size() < 3 || calibration.ground->marks.size() < 3) return nullptr;
  const HeightPlane shift = calib::GroundShift(*calibration.ground, marks);
  return {{"shift_mm", 1000 * shift.offset_m},
          {"tilt_mm", 500 * (std::abs(shift.slope_x) * config.plate.size_x_m + std::abs(shift.slope_y) * config.plate.size_y_m)},
          {"fiducials", marks.size()}};
}

}  // namespace sole::app
