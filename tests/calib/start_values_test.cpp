#include "calib/start_values.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "core/error.h"
#include "tests/calib/synthetic_rig.h"

namespace sole::calib {
namespace {

using testing::HasSubstr;
using testing_support::MakeSyntheticRig;
using testing_support::ObserveSynthetic;
using testing_support::SyntheticRig;

AdjustState Start(const SyntheticRig& rig, const TakeObservations& take) {
  const TargetConfig& t = rig.config.target;
  return StartValues(
      rig.config, take,
      TargetCorners(MakeCalibrationCube(t.edge_m, t.squares, t.square_m, t.marker_m)),
      FiducialCornerPoints(rig.config.plate));
}

/// Nominal intrinsics and no distortion leave start values about a centimetre and a degree off.
void ExpectNear(const SyntheticRig& rig, const AdjustState& state) {
  for (std::size_t c = 0; c < rig.cam_from_world.size(); ++c) {
    EXPECT_LT((state.cameras[c].CentreInWorld() - rig.Centre(c)).norm(), 0.02) << "camera " << c;
    EXPECT_LT(
        state.cameras[c].cam_from_world.rotation.angularDistance(rig.cam_from_world[c].rotation),
        0.03)
        << "camera " << c;
  }
  for (std::size_t f = 0; f < rig.world_from_body.size(); ++f) {
    EXPECT_LT((state.world_from_body[f].translation - rig.world_from_body[f].translation).norm(),
              0.02)
        << "frame " << f;
    EXPECT_LT(state.world_from_body[f].rotation.angularDistance(rig.world_from_body[f].rotation),
              0.05)
        << "frame " << f;
  }
}

TEST(StartValues, ComeFromTheImagesAloneWhereverTheRigFilePutsTheCameras) {
  SyntheticRig rig = MakeSyntheticRig(8, 6, 1);
  const TakeObservations take = ObserveSynthetic(rig, 0.1, 1);
  for (CameraConfig& camera : rig.config.cameras) camera.position_m = {9, 9, 9};
  ExpectNear(rig, Start(rig, take));
}

TEST(StartValues, CamerasWithoutFiducialsFollowFromSharedTargets) {
  const SyntheticRig rig = MakeSyntheticRig(8, 6, 2);
  TakeObservations take = ObserveSynthetic(rig, 0.1, 2);
  for (auto& frame : take.frames) {
    for (std::size_t c = 1; c < frame.size(); ++c) frame[c].fiducials.clear();
  }
  ExpectNear(rig, Start(rig, take));
}

TEST(StartValues, OneWrongFiducialViewDoesNoHarm) {
  const SyntheticRig rig = MakeSyntheticRig(4, 5, 3);
  TakeObservations take = ObserveSynthetic(rig, 0.1, 3);
  for (auto& view : take.frames[2]) {
    for (auto& seen : view.fiducials) seen.pixel.x() += 300;
  }
  ExpectNear(rig, Start(rig, take));
}

TEST(StartValues, NameTheCameraThatCannotBePlaced) {
  const SyntheticRig rig = MakeSyntheticRig(4, 4, 4);
  TakeObservations take = ObserveSynthetic(rig, 0.1, 4);
  for (auto& frame : take.frames) frame[2] = {};
  try {
    Start(rig, take);
    FAIL() << "camera without any observation was placed";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("camera SIM0003 sees no fiducials and no target pose"));
  }
  for (auto& frame : take.frames) {
    for (auto& view : frame) view.fiducials.clear();
  }
  EXPECT_THROW(Start(rig, take), Error);
}

}  // namespace
}  // namespace sole::calib
