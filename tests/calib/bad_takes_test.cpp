#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/calibrate.h"
#include "tests/calib/synthetic_rig.h"
#include "tests/support/error_matcher.h"

namespace sole::calib {
namespace {

using sole::testing_support::ErrorOf;
using testing::AllOf;
using testing::HasSubstr;
using testing_support::MakeSyntheticRig;
using testing_support::ObserveSynthetic;
using testing_support::SyntheticRig;

std::string MessageOf(const RigConfig& config, const TakeObservations& take) {
  return ErrorOf([&] { CalibrateFromObservations(config, take); });
}

TEST(BadTakes, ACameraThatLooksElsewhereIsNamed) {
  SyntheticRig rig = MakeSyntheticRig(8, 10, 11);
  // Turned by a right angle where it stands: the plate is out of its view.
  Rigid3 turn;
  turn.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitY()));
  rig.cam_from_world[5] = turn * rig.cam_from_world[5];
  const TakeObservations take = ObserveSynthetic(rig, 0.02, 11);
  ASSERT_TRUE(take.frames[0][5].fiducials.empty());
  EXPECT_THAT(MessageOf(rig.config, take),
              AllOf(HasSubstr("camera SIM0006 sees the target in 0 of 10 frames"),
                    HasSubstr("check its aim")));
}

TEST(BadTakes, ACameraThatSeesTheTargetAtTimesOnlyIsNamed) {
  const SyntheticRig rig = MakeSyntheticRig(8, 10, 12);
  TakeObservations take = ObserveSynthetic(rig, 0.02, 12);
  for (std::size_t f = 2; f < take.frames.size(); ++f) take.frames[f][3].target.clear();
  EXPECT_THAT(MessageOf(rig.config, take),
              HasSubstr("camera SIM0004 sees the target in 2 of 10 frames, needs 3"));
}

TEST(BadTakes, APlateThatNobodySeesTheMarksOfIsSaid) {
  SyntheticRig rig = MakeSyntheticRig(4, 10, 13);
  const TakeObservations take = ObserveSynthetic(rig, 0.02, 13);
  TakeObservations unmarked = take;
  for (auto& frame : unmarked.frames) {
    for (ViewObservations& view : frame)
      std::erase_if(view.fiducials, [](const PointObservation& o) { return o.point >= 4; });
  }
  EXPECT_THAT(MessageOf(rig.config, unmarked), HasSubstr("no camera sees two fiducials"));
}

TEST(BadTakes, AFacePrintedLargerThanTheOthersContradictsThem) {
  const SyntheticRig rig = MakeSyntheticRig(4, 10, 14);
  SyntheticRig larger = rig;
  larger.config.target.square_m *= 1.02;
  larger.config.target.marker_m *= 1.02;
  const TakeObservations right = ObserveSynthetic(rig, 0, 14),
                         wrong = ObserveSynthetic(larger, 0, 14);
  constexpr int kCornersOfAFace = 16, kFace = 0;  // the lower one, which the pair below sees
  TakeObservations mixed = right;
  int replaced = 0;
  for (std::size_t f = 0; f < mixed.frames.size(); ++f) {
    for (std::size_t c = 0; c < mixed.frames[f].size(); ++c) {
      for (PointObservation& o : mixed.frames[f][c].target) {
        if (o.point / kCornersOfAFace != kFace) continue;
        for (const PointObservation& other : wrong.frames[f][c].target) {
          if (other.point == o.point) o.pixel = other.pixel, ++replaced;
        }
      }
    }
  }
  ASSERT_GT(replaced, 100);
  EXPECT_EQ(MessageOf(rig.config, right), "(no error was thrown)");
  EXPECT_THAT(MessageOf(rig.config, mixed),
              AllOf(HasSubstr("contradict"), HasSubstr("check the sizes in [target]")));
}

}  // namespace
}  // namespace sole::calib
