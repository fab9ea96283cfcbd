#include "calib/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "calib/judge.h"
#include "core/error.h"
#include "tests/calib/synthetic_rig.h"
#include "tests/support/error_matcher.h"

namespace sole::calib {
namespace {

using testing::HasSubstr;
using sole::testing_support::ErrorOf;
using testing_support::MakeSyntheticRig;
using testing_support::ObserveSynthetic;
using testing_support::SyntheticRig;

TEST(Calibrate, JudgesHeldOutPosesInMillimetres) {
  const SyntheticRig rig = MakeSyntheticRig(4, 20, 1);
  const Calibration calibration =
      CalibrateFromObservations(rig.config, ObserveSynthetic(rig, 0.02, 1));
  EXPECT_EQ(calibration.stats.poses_used, 16);
  EXPECT_EQ(calibration.stats.poses_heldout, 4);
  EXPECT_LT(calibration.stats.reprojection_rms_px, 0.021);
  // Noise of 0.02 px at this base line is 0.03 mm in depth for a single point.
  EXPECT_LT(calibration.stats.heldout_rms_air_mm, 0.03);
  EXPECT_LT(calibration.stats.heldout_rms_glass_mm, 0.03);
  EXPECT_GT(calibration.stats.heldout_rms_glass_mm, 0.005);
  EXPECT_LT(calibration.stats.ground_rms_mm, 0.01);
  EXPECT_EQ(calibration.covariance.rows(), 4 * 15 + 1);
  EXPECT_EQ(calibration.rig.rig_hash, RigIdentityHash(rig.config));
  ASSERT_EQ(calibration.rig.pairs.size(), 2u);
  EXPECT_EQ(calibration.rig.pairs[1].right, 3);
}

TEST(Calibrate, SameObservationsGiveTheSameBits) {
  const SyntheticRig rig = MakeSyntheticRig(4, 10, 2);
  const TakeObservations take = ObserveSynthetic(rig, 0.02, 2);
  const Calibration a = CalibrateFromObservations(rig.config, take),
                    b = CalibrateFromObservations(rig.config, take);
  EXPECT_EQ(a.rig.cameras[3].intrinsics, b.rig.cameras[3].intrinsics);
  EXPECT_EQ(a.covariance, b.covariance);
}

TEST(Calibrate, IgnoringTheGlassSpoilsHeldOutLengths) {
  // Free intrinsics absorb most of the refraction, so the noise must be small to see what is left.
  SyntheticRig rig = MakeSyntheticRig(testing_support::ObliqueRig(), 8, 3);
  const TakeObservations take = ObserveSynthetic(rig, 0.002, 3);
  const CalibrationStats with = CalibrateFromObservations(rig.config, take).stats;
  rig.config.plate.index = 1;
  EXPECT_THAT(ErrorOf([&] { CalibrateFromObservations(rig.config, take); }),
              HasSubstr("contradict the others"));
  CalibrateOptions lenient;
  lenient.max_outlier_share = 1;
  lenient.max_fiducial_sigmas = 1e9;
  const CalibrationStats without = CalibrateFromObservations(rig.config, take, lenient).stats;
  EXPECT_GT(without.heldout_rms_glass_mm, 4 * with.heldout_rms_glass_mm);
  EXPECT_GT(without.ground_rms_mm, 10 * with.ground_rms_mm);
  EXPECT_GT(without.reprojection_rms_px, 4 * with.reprojection_rms_px);
}

TEST(Calibrate, IgnoringThePlateFailsInMillimetres) {
  for (const std::uint64_t seed : {1, 2, 3}) {
    const SyntheticRig rig = MakeSyntheticRig(20, 30, seed);
    const TakeObservations take = ObserveSynthetic(rig, 0.011, seed);
    const Calibration with = CalibrateFromObservations(rig.config, take);
    EXPECT_THAT(with.stats.failures, testing::IsEmpty());
    ASSERT_EQ(with.stats.pair_offset_mm.size(), rig.config.pairs.size());
    for (std::size_t i = 0; i < rig.config.pairs.size(); ++i) {
      EXPECT_LT(with.stats.pair_offset_mm[i], 0.01) << rig.config.pairs[i].name;
      // A corner's noise across the curve, once per image, each coordinate 0.011 px.
      EXPECT_NEAR(with.stats.pair_epipolar_px[i], 0.0156, 0.004) << rig.config.pairs[i].name;
    }
    EXPECT_LT(with.stats.heldout_rms_air_mm, 0.010);
    EXPECT_LT(with.stats.heldout_rms_glass_mm, 0.015);
    double centres = 0;
    for (std::size_t c = 0; c < 20; ++c) {
      centres += (with.rig.cameras[c].CentreInWorld() - rig.Centre(c)).squaredNorm();
      EXPECT_LT(with.rig.cameras[c].cam_from_world.rotation.angularDistance(
                    rig.cam_from_world[c].rotation),
                0.009 * M_PI / 180);
    }
    EXPECT_LT(1000 * std::sqrt(centres / 20), 0.05);

    // The pinhole cameras absorb most of it: the pixels hardly tell, the oblique pair does.
    CalibrateOptions options;
    options.ignore_plate = true;
    const Calibration without = CalibrateFromObservations(rig.config, take, options);
    EXPECT_LT(without.stats.reprojection_rms_px, 0.013);
    EXPECT_THAT(without.stats.failures,
                testing::Contains(HasSubstr("pair below side sees the held-out target displaced")));
    EXPECT_EQ(without.rig.rig_hash, with.rig.rig_hash);
  }
}

TEST(Failures, EveryFigureHasItsLimit) {
  Rig rig;
  rig.pairs = {{"one", 0, 1}, {"two", 0, 1}};
  CalibrationStats stats;
  stats.heldout_points = 100;
  stats.pair_offset_mm = {0.01, std::nan("")};
  EXPECT_THAT(Failures(rig, stats), testing::IsEmpty());
  stats.heldout_rms_air_mm = stats.heldout_rms_glass_mm = stats.heldout_rms_across_mm = 0.05;
  stats.heldout_max_mm = 0.5;
  stats.ground_rms_mm = 0.03;
  stats.heldout_rejected = 3;
  stats.pair_offset_mm[0] = 0.04;
  const std::vector<std::string> failures = Failures(rig, stats);
  EXPECT_EQ(failures.size(), 7u);
  EXPECT_THAT(failures, testing::Contains("pair one sees the held-out target displaced: RMS 0.040 mm, limit 0.030 mm"));
}

TEST(JudgeGround, KnownCamerasWithoutGlassSeeItRisenByMillimetres) {
  const SyntheticRig rig = MakeSyntheticRig(4, 1, 5);
  Rig known;
  for (std::size_t c = 0; c < 2; ++c) {
    Camera camera{"", 1624, 1236, Intrinsics::Zero(), rig.cam_from_world[c]};
    camera.intrinsics.head<8>() = rig.lens[c];
    known.cameras.push_back(camera);
  }
  TakeObservations take = ObserveSynthetic(rig, 0, 5);
  take.frames[0].resize(2);
  known.plate = {rig.thickness_m, rig.index};
  EXPECT_LT(JudgeGround(known, take).rms_mm, 1e-6);
  EXPECT_EQ(JudgeGround(known, take).lengths, 10);
  known.plate.index = 1;
  // Near the perpendicular the apparent rise is t (1 - 1/n).
  EXPECT_NEAR(JudgeGround(known, take, 20).rms_mm, 1000 * rig.thickness_m * (1 - 1 / rig.index),
              0.3);
}

TEST(Calibrate, RefusesWhatCannotBeCalibrated) {
  const SyntheticRig rig = MakeSyntheticRig(4, 10, 4);
  const TakeObservations good = ObserveSynthetic(rig, 0.02, 4);
  const auto message = [&](const TakeObservations& take) {
    return ErrorOf([&] { CalibrateFromObservations(rig.config, take); });
  };
  EXPECT_EQ(message(good), "(no error was thrown)");

  TakeObservations few = good;
  few.frames.resize(5);
  EXPECT_THAT(message(few),
              HasSubstr("too few poses: the target is seen in 5 of 5 frames, needs 6"));

  TakeObservations blind = good;
  for (auto& frame : blind.frames) frame[1].target.clear();
  EXPECT_THAT(message(blind), HasSubstr("camera SIM0002 sees the target in 0 of 10 frames"));

  for (auto& frame : blind.frames) frame[1].mirrored_target = true;
  EXPECT_THAT(message(blind), HasSubstr("camera SIM0002 shows the target mirrored in 10 of 10"));

  TakeObservations unmarked = good;
  for (auto& frame : unmarked.frames) {
    for (auto& view : frame) view.fiducials.clear();
  }
  EXPECT_THAT(message(unmarked), HasSubstr("no camera sees a fiducial"));

  EXPECT_THAT(message(TakeObservations{}), HasSubstr("0 of 0 frames"));
}

TEST(Calibrate, RefusesATargetOfAnotherSize) {
  SyntheticRig rig = MakeSyntheticRig(4, 10, 6);
  const TakeObservations take = ObserveSynthetic(rig, 0.02, 6);
  rig.config.target.square_m *= 0.98;
  rig.config.target.marker_m *= 0.98;
  EXPECT_THAT(ErrorOf([&] { CalibrateFromObservations(rig.config, take); }),
              HasSubstr("target and fiducials contradict each other"));
}

class OneFrame : public FrameSource {
 public:
  explicit OneFrame(FrameSet frame) : frame_(std::move(frame)) {}
  std::optional<FrameSet> Next() override { return std::exchange(frame_, std::nullopt); }

 private:
  std::optional<FrameSet> frame_;
};

TEST(Calibrate, RefusesImagesOfAnotherSize) {
  const RigConfig config = MakeDefaultRig(4);
  FrameSet frame;
  frame.trigger = 7;
  frame.images.assign(4, ImageU8(1624, 1236));
  frame.images[2] = ImageU8(812, 618);
  OneFrame source(frame);
  EXPECT_THAT(ErrorOf([&] { Calibrate(config, source); }),
              HasSubstr("camera SIM0003, frame 7: image is 812x618, the rig file says 1624x1236"));
  frame.images.pop_back();
  OneFrame short_source(frame);
  EXPECT_THAT(ErrorOf([&] { Calibrate(config, short_source); }),
              HasSubstr("images of 3 cameras"));
}

TEST(NearestPoint, IsTheCrossingOfRays) {
  const Eigen::Vector3d point(0.1, -0.2, 0.3);
  std::vector<Ray> rays;
  for (const Eigen::Vector3d& origin :
       {Eigen::Vector3d(0, 0, 1), Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(1, 1, 1)}) {
    rays.push_back({origin, (point - origin).normalized()});
  }
  EXPECT_LT((NearestPoint(rays) - point).norm(), 1e-12);
  const std::vector<Ray> parallel{{{0, 0, 0}, {0, 0, 1}}, {{1, 0, 0}, {0, 0, 1}}};
  EXPECT_FALSE(NearestPoint(parallel).allFinite());
}

}  // namespace
}  // namespace sole::calib
