#include "calib/drift.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "calib/adjust.h"
#include "calib/detect.h"
#include "calib/judge.h"
#include "calib/start_values.h"
#include "calib/verdict.h"
#include "core/error.h"

namespace sole::calib {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

std::size_t At(int index) { return static_cast<std::size_t>(index); }

/// A take's points, and the state of the rig as calibrated with the target where all cameras see it.
struct Scene {
  std::vector<Eigen::Vector3d> corners, fiducials;
  TakeObservations take;  ///< fiducials averaged, in the first frame
  AdjustState state;
};

/// Frames in which less of the target is seen tell nothing.
constexpr std::size_t kLeastFrameCorners = 12;

Scene MakeScene(const Calibration& calibration, const RigConfig& config,
                const TakeObservations& observations) {
  Scene scene;
  scene.corners = TargetCorners(TargetOf(config).body);
  scene.fiducials = FiducialCornerPoints(config.plate);
  const std::size_t cameras = calibration.rig.cameras.size();
  // The first frame holds the fiducials and no target.
  scene.take.frames.emplace_back(cameras);
  for (std::size_t c = 0; c < cameras; ++c) {
    scene.take.frames[0][c].fiducials = MeanFiducials(observations, c, 0.02);
  }
  for (const auto& frame : observations.frames) {
    std::size_t seen = 0;
    for (const ViewObservations& view : frame) seen += view.target.size();
    if (seen < kLeastFrameCorners) continue;
    auto& kept = scene.take.frames.emplace_back(frame);
    for (ViewObservations& view : kept) view.fiducials.clear();
  }
  scene.state.cameras = calibration.rig.cameras;
  scene.state.plate = calibration.rig.plate;
  scene.state.world_from_body.resize(scene.take.frames.size());
  scene.state.fiducial_offset_m.assign(config.plate.fiducials.size(), Eigen::Vector2d::Zero());
  PlaceTargets(scene.state, scene.take, scene.corners);
  return scene;
}

/// All cameras but one kept; -1 keeps all.
AdjustOptions Keeping(const Scene& scene, int free_camera) {
  AdjustOptions options;
  options.estimate_thickness = false;
  options.keep_pose.assign(scene.state.cameras.size(), true);
  options.keep_intrinsics = options.keep_pose;
  if (free_camera >= 0) options.keep_pose[At(free_camera)] = false;
  return options;
}

/// The scene's points of one camera only, its own target poses kept out: what a camera says by itself.
TakeObservations OnlyFiducialsOf(const Scene& scene, int camera) {
  TakeObservations take;
  take.frames.emplace_back(scene.state.cameras.size());
  take.frames[0][At(camera)].fiducials = scene.take.frames[0][At(camera)].fiducials;
  return take;
}

double ResidualPx(const Scene& scene, const Rig& rig, int camera) {
  const Projector project(rig.cameras[At(camera)], rig.plate);
  double squares = 0;
  int count = 0;
  for (const PointObservation& o : scene.take.frames[0][At(camera)].fiducials) {
    squares += (project(scene.fiducials[At(o.point)]) - o.pixel).squaredNorm();
    ++count;
  }
  for (std::size_t f = 1; f < scene.take.frames.size(); ++f) {
    for (const PointObservation& o : scene.take.frames[f][At(camera)].target) {
      const Eigen::Vector3d world = scene.state.world_from_body[f] * scene.corners[At(o.point)];
      const double miss = (project(world) - o.pixel).norm();
      squares += miss * miss;
      ++count;
    }
  }
  return std::sqrt(squares / std::max(1, count));
}

/// Target poses as the other cameras see them.
void RefineTargets(Scene& scene, int without) {
  if (scene.take.frames.size() < 2) return;
  TakeObservations others = scene.take;
  for (auto& frame : others.frames) {
    if (without >= 0) frame[At(without)] = {};
  }
  // A frame that only this camera sees keeps its pose and must not count.
  AdjustState state = scene.state;
  PlaceTargets(state, others, scene.corners);
  scene.state.world_from_body =
      Adjust(state, others, scene.corners, scene.fiducials, Keeping(scene, -1))
          .state.world_from_body;
  for (std::size_t f = 1; f < scene.take.frames.size(); ++f) {
    std::size_t seen = 0;
    for (const ViewObservations& view : others.frames[f]) seen += view.target.size();
    if (seen < kLeastFrameCorners) scene.take.frames[f][At(without)].target.clear();
  }
}

CameraDrift JudgeCamera(const Calibration& calibration, const Scene& all, int camera,
                        const DriftOptions& options) {
  CameraDrift drift;
  Scene scene = all;
  RefineTargets(scene, camera);
  const Camera& before = scene.state.cameras[At(camera)];
  drift.serial = before.serial;
  drift.cam_from_world = before.cam_from_world;
  drift.fiducial_corners =
      static_cast<int>(scene.take.frames[0][At(camera)].fiducials.size());
  for (std::size_t f = 1; f < scene.take.frames.size(); ++f) {
    drift.target_corners += static_cast<int>(scene.take.frames[f][At(camera)].target.size());
  }
  drift.judged = drift.fiducial_corners + drift.target_corners >= options.min_corners;
  if (!drift.judged) return drift;
  Rig rig = calibration.rig;
  drift.residual_px = ResidualPx(scene, rig, camera);

  // This camera alone: its fiducials, and the target where the others put it.
  TakeObservations own = OnlyFiducialsOf(scene, camera);
  for (std::size_t f = 1; f < scene.take.frames.size(); ++f) own.frames.push_back(scene.take.frames[f]);
  const AdjustResult moved =
      Adjust(scene.state, own, scene.corners, scene.fiducials, Keeping(scene, camera));
  const Camera& after = moved.state.cameras[At(camera)];
  rig.cameras[At(camera)] = after;
  drift.residual_after_px = ResidualPx(scene, rig, camera);
  drift.cam_from_world = after.cam_from_world;
  drift.moved_mm = 1000 * (after.CentreInWorld() - before.CentreInWorld()).norm();
  drift.turned_deg = after.cam_from_world.rotation.angularDistance(before.cam_from_world.rotation) *
                     180 / M_PI;
  const Eigen::Index at = 15 * static_cast<Eigen::Index>(camera);
  drift.moved_sigma_mm = 1000 * std::sqrt(moved.covariance.block<3, 3>(at + 3, at + 3).trace());
  drift.moved = drift.residual_px > options.min_residual_px &&
                drift.residual_after_px < 0.5 * drift.residual_px;
  return drift;
}

double GapPx(const Rig& rig, int pair, const std::vector<PairMatch>& matches, int& count) {
  const StereoPair& p = rig.pairs[At(pair)];
  double squares = 0;
  count = 0;
  for (const PairMatch& match : matches) {
    if (match.pair != pair) continue;
    const Camera &left = rig.cameras[At(p.left)], &right = rig.cameras[At(p.right)];
    const RayIntersection hit = IntersectRays(RayFromPixel(left, rig.plate, match.left_px),
                                              RayFromPixel(right, rig.plate, match.right_px));
    const double miss = (PixelFromWorld(left, rig.plate, hit.point) - match.left_px).norm() +
                        (PixelFromWorld(right, rig.plate, hit.point) - match.right_px).norm();
    if (!std::isfinite(miss)) continue;
    squares += miss * miss;
    ++count;
  }
  return count > 0 ? std::sqrt(squares / count) : 0;
}

void RequireFitting(const Calibration& calibration, const RigConfig& config,
                    const TakeObservations& observations) {
  Require(calibration.rig.cameras.size() == config.cameras.size(),
          "drift check: the calibration has " + std::to_string(calibration.rig.cameras.size()) +
              " cameras, the take " + std::to_string(config.cameras.size()));
  for (const auto& frame : observations.frames) {
    Require(frame.size() == config.cameras.size(), "drift check: a frame lacks cameras");
  }
}

}  // namespace

DriftReport CheckDrift(const Calibration& calibration, const RigConfig& config,
                       const TakeObservations& observations, const std::vector<PairMatch>& matches,
                       const DriftOptions& options) {
  RequireFitting(calibration, config, observations);
  const Scene scene = MakeScene(calibration, config, observations);
  DriftReport report;
  Rig after = calibration.rig;
  int judged = 0;
  for (int c = 0; c < static_cast<int>(config.cameras.size()); ++c) {
    report.cameras.push_back(JudgeCamera(calibration, scene, c, options));
    judged += report.cameras.back().judged;
    if (!report.cameras.back().moved) continue;
    report.moved.push_back(c);
    after.cameras[At(c)].cam_from_world = report.cameras.back().cam_from_world;
  }
  Require(judged > 0,
          "drift check: no camera sees enough fiducials or corners of the target; record a frame "
          "in which the plate's marks are lit and free");
  report.everything_moved = judged > 2 && 2 * static_cast<int>(report.moved.size()) > judged;
  for (int p = 0; p < static_cast<int>(after.pairs.size()); ++p) {
    PairDrift pair{after.pairs[At(p)].name, 0, 0, 0};
    pair.gap_px = GapPx(calibration.rig, p, matches, pair.matches);
    pair.gap_after_px = GapPx(after, p, matches, pair.matches);
    report.pairs.push_back(pair);
  }
  return report;
}

Calibration ReadjustCamera(const Calibration& calibration, const RigConfig& config,
                           const TakeObservations& observations, int camera) {
  RequireFitting(calibration, config, observations);
  Scene scene = MakeScene(calibration, config, observations);
  RefineTargets(scene, camera);
  const AdjustResult adjusted = Adjust(scene.state, scene.take, scene.corners, scene.fiducials,
                                       Keeping(scene, camera));
  Calibration result = calibration;
  result.rig.cameras[At(camera)].cam_from_world = adjusted.state.cameras[At(camera)].cam_from_world;
  const Eigen::Index at = 15 * static_cast<Eigen::Index>(camera);
  if (result.covariance.size() > 0) {
    result.covariance.middleRows<6>(at).setZero();
    result.covariance.middleCols<6>(at).setZero();
    result.covariance.block<6, 6>(at, at) = adjusted.covariance.block<6, 6>(at, at);
  }
  CalibrationStats& stats = result.stats;
  stats.reprojection_rms_px = adjusted.reprojection_rms_px;
  stats.camera_rms_px = adjusted.camera_rms_px;
  stats.camera_corners = adjusted.camera_corners;
  TakeObservations target = scene.take;
  target.frames.erase(target.frames.begin());
  const TargetErrors errors = JudgeTarget(result.rig, target, scene.corners);
  const auto rms = [](const LengthErrors& e) { return e.lengths > 0 ? e.rms_mm : kUnknown; };
  stats.heldout_rms_air_mm = rms(errors.air);
  stats.heldout_rms_glass_mm = rms(errors.glass);
  stats.heldout_rms_across_mm = rms(errors.across);
  stats.heldout_max_mm =
      errors.air.lengths + errors.glass.lengths > 0
          ? std::max({errors.air.max_mm, errors.glass.max_mm, errors.across.max_mm})
          : kUnknown;
  stats.heldout_points = errors.points;
  stats.heldout_rejected = errors.air.rejected + errors.glass.rejected;
  stats.pair_offset_mm.clear();
  stats.pair_epipolar_px.clear();
  for (const PairErrors& pair : JudgePairs(result.rig, target, scene.corners)) {
    stats.pair_offset_mm.push_back(pair.offset_mm);
    stats.pair_epipolar_px.push_back(pair.epipolar_px);
  }
  stats.ground_rms_mm = JudgeGround(result.rig, scene.take).rms_mm;
  stats.poses_used = 0;
  stats.poses_heldout = static_cast<int>(target.frames.size());
  stats.failures = Failures(result.rig, stats);
  return result;
}

}  // namespace sole::calib
