#include "calib/calibrate.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <string>

#include "calib/judge.h"
#include "calib/start_values.h"
#include "calib/verdict.h"
#include "core/error.h"

namespace sole::calib {
namespace {

int CornersIn(const std::vector<ViewObservations>& frame) {
  std::size_t corners = 0;
  for (const ViewObservations& view : frame) corners += view.target.size();
  return static_cast<int>(corners);
}

void RequireEnough(const RigConfig& config, const TakeObservations& observations,
                   const CalibrateOptions& options) {
  const std::string frames = std::to_string(observations.frames.size());
  for (std::size_t c = 0; c < config.cameras.size(); ++c) {
    int seen = 0;
    int mirrored = 0;
    for (const auto& frame : observations.frames) {
      seen += frame[c].target.size() >= 4;
      mirrored += frame[c].mirrored_target;
    }
    Require(seen >= options.min_camera_frames || mirrored < options.min_camera_frames,
            "calibration: camera " + config.cameras[c].serial + " shows the target mirrored in " +
                std::to_string(mirrored) + " of " + frames +
                " frames; turn off the camera's flipping, or print the target unmirrored");
    Require(seen >= options.min_camera_frames,
            "calibration: camera " + config.cameras[c].serial + " sees the target in " +
                std::to_string(seen) + " of " + frames + " frames, needs " +
                std::to_string(options.min_camera_frames) +
                "; check its aim, light and focus, or hold the target where it looks");
  }
  const auto usable = std::count_if(
      observations.frames.begin(), observations.frames.end(),
      [&](const auto& frame) { return CornersIn(frame) >= options.min_frame_corners; });
  Require(usable >= options.min_poses,
          "calibration: too few poses: the target is seen in " + std::to_string(usable) + " of " +
              frames + " frames, needs " + std::to_string(options.min_poses) + "; record more");
  const bool fiducial =
      std::any_of(observations.frames.begin(), observations.frames.end(), [](const auto& frame) {
        return std::any_of(frame.begin(), frame.end(),
                           [](const auto& view) { return !view.fiducials.empty(); });
      });
  Require(
      fiducial,
      "calibration: no camera sees a fiducial of the plate, which define the world frame; check "
      "[[plate.fiducial]] in the rig file, light and focus");
}

void RequireAgreement(const AdjustResult& adjusted, const CalibrateOptions& options) {
  int kept = 0;
  for (const int corners : adjusted.camera_corners) kept += corners;
  const double share =
      static_cast<double>(adjusted.outliers) / std::max(1, kept + adjusted.outliers);
  Require(share <= options.max_outlier_share,
          "calibration: " + std::to_string(std::lround(100 * share)) +
              " % of the measured points contradict the others; check the sizes in [target] and "
              "[[plate.fiducial]] of the rig file, and that nothing but the target moved");
  // A target of another scale shows as fiducials that all lie elsewhere.
  double squares = 0;
  for (const Eigen::Vector2d& offset : adjusted.state.fiducial_offset_m) {
    squares += offset.squaredNorm();
  }
  const double count = static_cast<double>(adjusted.state.fiducial_offset_m.size());
  const double rms_m = std::sqrt(squares / std::max(1.0, count));
  char text[32];
  std::snprintf(text, sizeof text, "%.2f mm", 1000 * rms_m);
  Require(
      rms_m <= options.max_fiducial_sigmas * options.adjust.fiducial_tolerance_m,
      std::string("calibration: target and fiducials contradict each other: measured with the "
                  "target, the fiducials lie ") +
          text +
          " from their places; check the sizes in [target] and [[plate.fiducial]] of the rig file");
}

}  // namespace

TakeObservations Observe(const RigConfig& config, FrameSource& takes,
                         const DetectOptions& options) {
  const DetectTarget target = TargetOf(config);
  TakeObservations speckle, texture;
  while (const auto frame = takes.Next()) {
    TakeObservations& kind = frame->kind == ExposureKind::kSpeckle ? speckle : texture;
    kind.frames.push_back(DetectInFrame(*frame, config, target, options));
  }
  return texture.frames.empty() ? speckle : texture;
}

DividedTake DivideTake(const RigConfig& config, const TakeObservations& observations,
                       const CalibrateOptions& options) {
  RequireEnough(config, observations, options);
  DividedTake take;
  int count = 0;
  for (const auto& frame : observations.frames) {
    if (CornersIn(frame) < options.min_frame_corners) continue;
    const bool judge = options.heldout_every > 0 && ++count % options.heldout_every == 0;
    auto& kept = (judge ? take.heldout : take.adjust).frames.emplace_back(frame);
    for (ViewObservations& view : kept) view.fiducials.clear();
  }
  for (std::size_t c = 0; c < config.cameras.size(); ++c) {
    take.adjust.frames.front()[c].fiducials =
        MeanFiducials(observations, c, options.detect.fiducial_sigma_floor_px);
  }
  return take;
}

void JudgeRig(const Rig& rig, const RigConfig& config, const DividedTake& take,
              const CalibrationLimits& limits, CalibrationStats& stats) {
  const std::vector<Eigen::Vector3d> corners = TargetCorners(TargetOf(config).body);
  const TargetErrors heldout = JudgeTarget(rig, take.heldout, corners);
  const auto rms = [](const LengthErrors& errors) { return errors.lengths > 0 ? errors.rms_mm : std::nan(""); };
  stats.heldout_rms_air_mm = rms(heldout.air);
  stats.heldout_rms_glass_mm = rms(heldout.glass);
  stats.heldout_rms_across_mm = rms(heldout.across);
  stats.heldout_max_mm =
      std::max({heldout.air.max_mm, heldout.glass.max_mm, heldout.across.max_mm});
  stats.heldout_points = heldout.points;
  stats.heldout_rejected = heldout.air.rejected + heldout.glass.rejected;
  stats.ground_rms_mm = rms(JudgeGround(rig, take.adjust));
  stats.poses_used = static_cast<int>(take.adjust.frames.size());
  stats.poses_heldout = static_cast<int>(take.heldout.frames.size());
  for (const PairErrors& pair : JudgePairs(rig, take.heldout, corners)) {
    stats.pair_offset_mm.push_back(pair.offset_mm);
    stats.pair_epipolar_px.push_back(pair.epipolar_px);
  }
  stats.failures = Failures(rig, stats, limits);
}

void CompleteRig(const RigConfig& config, Rig& rig) {
  for (const PairConfig& pair : config.pairs) {
    rig.pairs.push_back({pair.name, CameraIndex(config, pair.left), CameraIndex(config, pair.right)});
  }
  rig.rig_hash = RigIdentityHash(config);
}

std::string NowUtc() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

Calibration CalibrateFromObservations(const RigConfig& rig_config,
                                      const TakeObservations& observations,
                                      const CalibrateOptions& options) {
  Validate(rig_config);
  RigConfig config = rig_config;
  if (options.ignore_plate) config.plate.index = 1;
  const DividedTake take = DivideTake(config, observations, options);
  const std::vector<Eigen::Vector3d> corners = TargetCorners(TargetOf(config).body);
  const std::vector<Eigen::Vector3d> fiducials = FiducialCornerPoints(config.plate);
  const AdjustState start = StartValues(config, take.adjust, corners, fiducials);
  const AdjustResult adjusted = Adjust(start, take.adjust, corners, fiducials, options.adjust);
  if (!options.ignore_plate) RequireAgreement(adjusted, options);

  Calibration result;
  result.rig.cameras = adjusted.state.cameras;
  result.rig.plate = adjusted.state.plate;
  CompleteRig(rig_config, result.rig);
  CalibrationStats& stats = result.stats;
  stats.reprojection_rms_px = adjusted.reprojection_rms_px;
  stats.camera_rms_px = adjusted.camera_rms_px;
  stats.camera_corners = adjusted.camera_corners;
  JudgeRig(result.rig, config, take, options.limits, stats);
  result.covariance = adjusted.covariance;
  result.created = NowUtc();
  return result;
}

Calibration Calibrate(const RigConfig& config, FrameSource& takes,
                      const CalibrateOptions& options) {
  Validate(config);
  return CalibrateFromObservations(config, Observe(config, takes, options.detect), options);
}

}  // namespace sole::calib
