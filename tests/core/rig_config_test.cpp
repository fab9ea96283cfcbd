#include "core/rig_config.h"

#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/support/error_matcher.h"

namespace sole {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;

TEST(NominalCamFromWorld, LooksAlongZWithUpTowardsMinusY) {
  for (const CameraConfig& camera : MakeDefaultRig(20).cameras) {
    const Rigid3 cam_from_world = NominalCamFromWorld(camera);
    EXPECT_LT((cam_from_world * camera.position_m).norm(), 1e-14) << camera.serial;
    const Eigen::Vector3d aim = cam_from_world * camera.look_at_m;
    EXPECT_LT(aim.head<2>().norm(), 1e-14) << camera.serial;
    EXPECT_NEAR(aim.z(), (camera.look_at_m - camera.position_m).norm(), 1e-14);
    const Eigen::Vector3d up = cam_from_world.rotation * camera.up;
    EXPECT_NEAR(up.x(), 0, 1e-14) << camera.serial;
    EXPECT_LT(up.y(), -0.1) << camera.serial;
    EXPECT_NEAR(cam_from_world.rotation.norm(), 1, 1e-14);
  }
}

TEST(NominalCamFromWorld, AClosedFormView) {
  CameraConfig camera;  // above the plate, looking straight down, +y up in the image: +x must be right
  camera.position_m = {0.1, 0.2, 1};
  camera.look_at_m = {0.1, 0.2, 0};
  camera.up = {0, 1, 0};
  const Rigid3 pose = NominalCamFromWorld(camera);
  EXPECT_LT((pose * Eigen::Vector3d(0.4, 0.2, 0) - Eigen::Vector3d(0.3, 0, 1)).norm(), 1e-14);
  EXPECT_LT((pose * Eigen::Vector3d(0.1, 0.3, 0) - Eigen::Vector3d(0, -0.1, 1)).norm(), 1e-14);
}

TEST(NominalCamFromWorld, RefusesUpAlongTheView) {
  CameraConfig camera;
  camera.serial = "A";
  camera.position_m = {0, 0, 1};
  EXPECT_THAT(ErrorOf([&] { NominalCamFromWorld(camera); }), HasSubstr("camera 'A': up is parallel"));
}

TEST(RigIdentityHash, ChangesWithWhatACalibrationDependsOnAndNothingElse) {
  const RigConfig rig = MakeDefaultRig();
  const std::string hash = RigIdentityHash(rig);
  EXPECT_EQ(hash.size(), 16U);
  const auto changed = [&](const std::function<void(RigConfig&)>& change) {
    RigConfig other = rig;
    change(other);
    return RigIdentityHash(other) != hash;
  };
  EXPECT_TRUE(changed([](RigConfig& r) { r.cameras[1].serial = "X"; }));
  EXPECT_TRUE(changed([](RigConfig& r) { r.cameras[1].width += 2; }));
  EXPECT_TRUE(changed([](RigConfig& r) { std::swap(r.pairs[0].left, r.pairs[0].right); }));
  EXPECT_TRUE(changed([](RigConfig& r) { r.plate.index += 1e-3; }));
  EXPECT_TRUE(changed([](RigConfig& r) { r.plate.fiducials[3].centre_m.x() += 1e-5; }));
  EXPECT_TRUE(changed([](RigConfig& r) { r.plate.fiducials.pop_back(); }));
  EXPECT_FALSE(changed([](RigConfig& r) { r.name = "other"; }));
  EXPECT_FALSE(changed([](RigConfig& r) { r.cameras[0].exposure_us = 1; }));
  EXPECT_FALSE(changed([](RigConfig& r) { r.cameras[0].position_m.x() += 0.1; }));
  EXPECT_FALSE(changed([](RigConfig& r) { r.trigger.rate_hz = 60; }));
}

TEST(Validate, NamesTheFirstInconsistency) {
  const auto error = [](const std::function<void(RigConfig&)>& change) {
    RigConfig rig = MakeDefaultRig();
    change(rig);
    return ErrorOf([&] { Validate(rig); });
  };
  EXPECT_THAT(error([](RigConfig& r) { r.cameras.clear(); }), HasSubstr("has no cameras"));
  EXPECT_THAT(error([](RigConfig& r) { r.cameras[1].serial = "SIM0001"; }), HasSubstr("'SIM0001': serial appears twice"));
  EXPECT_THAT(error([](RigConfig& r) { r.cameras[2].height = 10; }), HasSubstr("'SIM0003': width and height"));
  EXPECT_THAT(error([](RigConfig& r) { r.cameras[0].focal_px = 0; }), HasSubstr("focal_px"));
  EXPECT_THAT(error([](RigConfig& r) { r.cameras[0].packet_size = 100; }), HasSubstr("packet_size"));
  EXPECT_THAT(error([](RigConfig& r) { r.cameras[0].look_at_m = r.cameras[0].position_m; }), HasSubstr("look_at_m"));
  EXPECT_THAT(error([](RigConfig& r) { r.pairs[0].right = "Z"; }), HasSubstr("pair 'below': no camera 'Z'"));
  EXPECT_THAT(error([](RigConfig& r) { r.pairs[0].right = r.pairs[0].left; }), HasSubstr("names one camera twice"));
  EXPECT_THAT(error([](RigConfig& r) { r.trigger.rate_hz = 0; }), HasSubstr("rate_hz"));
  EXPECT_THAT(error([](RigConfig& r) { r.trigger.source = "x"; }), HasSubstr("trigger source 'x'"));
  EXPECT_THAT(error([](RigConfig& r) { r.plate.thickness_m = 0; }), HasSubstr("thickness_m"));
  EXPECT_THAT(error([](RigConfig& r) { r.plate.index = 0.5; }), HasSubstr("plate index"));
  EXPECT_THAT(error([](RigConfig& r) { r.plate.fiducials[1].id = 200; }), HasSubstr("fiducial id 200 appears twice"));
}

TEST(CameraIndex, FindsBySerial) {
  const RigConfig rig = MakeDefaultRig();
  EXPECT_EQ(CameraIndex(rig, "SIM0003"), 2);
  EXPECT_THAT(ErrorOf([&] { CameraIndex(rig, "none"); }), HasSubstr("no camera with serial 'none'"));
}

TEST(MakeDefaultRig, ScalesTheFocalLengthWithTheWidth) {
  EXPECT_DOUBLE_EQ(MakeDefaultRig(4, 812, 618).cameras[0].focal_px, 1625);
  EXPECT_THAT(ErrorOf([] { MakeDefaultRig(5); }), HasSubstr("4, 8 or 20 cameras, not 5"));
}

}  // namespace
}  // namespace sole
