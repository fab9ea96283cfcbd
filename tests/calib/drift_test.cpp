#include "calib/drift.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/calibrate.h"
#include "calib/detect.h"
#include "calib/judge.h"
#include "core/error.h"
#include "tests/calib/synthetic_rig.h"

namespace sole::calib {
namespace {

using testing_support::MakeSyntheticRig;
using testing_support::ObserveSynthetic;
using testing_support::SyntheticRig;

/// Camera `c` shifted by `shift_m` (world).
SyntheticRig Bumped(SyntheticRig rig, std::size_t c, const Eigen::Vector3d& shift_m) {
  Rigid3& pose = rig.cam_from_world[c];
  pose.translation -= pose.rotation * shift_m;
  return rig;
}

/// The first `poses` poses; without the target if `target` is false.
TakeObservations LaterTake(const SyntheticRig& rig, std::size_t poses, bool target,
                           std::uint64_t seed) {
  SyntheticRig later = rig;
  later.world_from_body.resize(poses);
  TakeObservations take = ObserveSynthetic(later, 0.02, seed);
  if (!target) {
    for (auto& frame : take.frames) {
      for (auto& view : frame) view.target.clear();
    }
  }
  return take;
}

std::vector<PairMatch> Matches(const SyntheticRig& rig, const Rig& nominal) {
  std::vector<PairMatch> matches;
  for (int p = 0; p < static_cast<int>(nominal.pairs.size()); ++p) {
    const StereoPair& pair = nominal.pairs[static_cast<std::size_t>(p)];
    for (double y = -0.08; y < 0.09; y += 0.04) {
      const Eigen::Vector3d point(0.01, y, 0.02);
      matches.push_back({p, TruePixel(rig, static_cast<std::size_t>(pair.left), point),
                         TruePixel(rig, static_cast<std::size_t>(pair.right), point)});
    }
  }
  return matches;
}

class Drift : public testing::Test {
 protected:
  SyntheticRig rig = MakeSyntheticRig(8, 20, 4);
  Calibration calibration =
      CalibrateFromObservations(rig.config, ObserveSynthetic(rig, 0.02, 4));
};

TEST_F(Drift, NothingMovedIsNothingNamed) {
  for (const bool target : {false, true}) {
    const DriftReport report =
        CheckDrift(calibration, rig.config, LaterTake(rig, 3, target, 50), Matches(rig, calibration.rig));
    EXPECT_THAT(report.moved, testing::IsEmpty());
    for (const CameraDrift& camera : report.cameras) {
      EXPECT_TRUE(camera.judged);
      EXPECT_LT(camera.residual_px, 0.1) << camera.serial;
    }
    for (const PairDrift& pair : report.pairs) EXPECT_LT(pair.gap_px, 0.1) << pair.name;
  }
}

TEST_F(Drift, ABumpedCameraIsNamedWithItsMovementAndReadjusted) {
  for (const std::size_t bumped : {std::size_t{1}, std::size_t{4}}) {
    for (const bool target : {false, true}) {
      const SyntheticRig after = Bumped(rig, bumped, Eigen::Vector3d(0.6, -0.6, 0.53) * 1e-3);
      const TakeObservations take = LaterTake(after, 3, target, 60 + bumped);
      const DriftReport report =
          CheckDrift(calibration, rig.config, take, Matches(after, calibration.rig));
      EXPECT_THAT(report.moved, testing::ElementsAre(static_cast<int>(bumped)));
      EXPECT_FALSE(report.everything_moved);
      const CameraDrift& camera = report.cameras[bumped];
      EXPECT_NEAR(camera.moved_mm, 1.0, 0.15) << bumped << target;
      EXPECT_LT(camera.residual_after_px, 0.1);
      const PairDrift& pair = report.pairs[bumped / 2];
      EXPECT_GT(pair.gap_px, 5 * pair.gap_after_px) << bumped << target;

      const Calibration restored =
          ReadjustCamera(calibration, rig.config, take, static_cast<int>(bumped));
      EXPECT_LT((restored.rig.cameras[bumped].CentreInWorld() - after.Centre(bumped)).norm(), 1.5e-4);
      for (std::size_t c = 0; c < rig.config.cameras.size(); ++c) {
        if (c == bumped) continue;
        EXPECT_EQ(restored.rig.cameras[c].cam_from_world.translation,
                  calibration.rig.cameras[c].cam_from_world.translation);
      }
      EXPECT_TRUE(restored.covariance.allFinite());
      if (!target) {
        EXPECT_TRUE(std::isnan(restored.stats.heldout_rms_air_mm));
        continue;
      }
      EXPECT_THAT(restored.stats.failures, testing::IsEmpty());
      EXPECT_LT(restored.stats.pair_offset_mm[bumped / 2],
                std::max(0.015, 2 * calibration.stats.pair_offset_mm[bumped / 2]));
      // The old calibration fails the same take.
      TakeObservations judged = take;
      const auto corners = TargetCorners(TargetOf(rig.config).body);
      EXPECT_GT(JudgePairs(calibration.rig, judged, corners)[bumped / 2].offset_mm, 0.05);
    }
  }
}

TEST_F(Drift, APlateThatMovedIsNotBlamedOnCameras) {
  SyntheticRig after = rig;
  for (Rigid3& pose : after.cam_from_world) {
    pose.translation -= pose.rotation * Eigen::Vector3d(0.001, 0, 0);
  }
  EXPECT_TRUE(CheckDrift(calibration, rig.config, LaterTake(after, 2, false, 70), {}).everything_moved);
}

TEST_F(Drift, ATakeWithoutMarksCannotBeJudged) {
  TakeObservations take = LaterTake(rig, 1, false, 80);
  for (auto& view : take.frames[0]) view.fiducials.clear();
  EXPECT_THROW(CheckDrift(calibration, rig.config, take, {}), Error);
}

}  // namespace
}  // namespace sole::calib
