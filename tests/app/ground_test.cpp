#include "app/ground.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/simulation.h"
#include "io/rig_file.h"
#include "io/take.h"
#include "sim/true_rig.h"
#include "tests/app/small_take.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

constexpr std::uint64_t kSeed = 6;

/// The simulator's rig as if calibration had been perfect.
Calibration TrueCalibration(const RigConfig& config) {
  Calibration calibration = testing_support::NominalCalibration(config);
  const sim::TrueRig truth = sim::DrawTrueRig(config, kSeed);
  for (std::size_t c = 0; c < truth.cameras.size(); ++c) {
    const sim::TrueCamera& t = truth.cameras[c];
    calibration.rig.cameras[c].intrinsics << t.fx, t.fy, t.cx, t.cy, t.k1, t.k2, t.p1, t.p2, 0;
    calibration.rig.cameras[c].cam_from_world = t.cam_from_world;
  }
  calibration.rig.plate = {truth.plate.thickness_m, truth.plate.index};
  return calibration;
}

/// One rendered take of the sheet by four cameras of half the size, shared by the tests.
class Ground : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    dir_ = new TempDir;
    config_ = MakeDefaultRig(4, 812, 618);
    Simulation simulation(config_, kSeed);
    WriteRendered(config_, simulation.RenderContactSheet(1), *dir_ / "sheet");
  }
  static void TearDownTestSuite() { delete dir_; }
  static TempDir* dir_;
  static RigConfig config_;
};
TempDir* Ground::dir_ = nullptr;
RigConfig Ground::config_;

TEST_F(Ground, LiesWhereTheRenderedGlassIs) {
  Calibration calibration = TrueCalibration(config_);
  const nlohmann::json account = AddGround(calibration, *dir_ / "sheet");
  ASSERT_TRUE(calibration.ground);
  double squares = 0;
  int count = 0;
  for (double x = -0.088; x < 0.089; x += 0.004) {
    for (double y = -0.178; y < 0.179; y += 0.004, ++count)
      squares += std::pow(1000 * HeightAt(*calibration.ground, {x, y}), 2);
  }
  EXPECT_LT(std::sqrt(squares / count), 0.004);
  EXPECT_LT(account["rms_mm"], 0.04);  // single points
  EXPECT_LT(account["sigma_mm"], 0.006);
  EXPECT_NEAR(account["thickness_mm"], 0.1, 0.006);
  EXPECT_LT(std::abs(account["shift_mm"].get<double>()), 0.025);  // fiducials of half the size
  EXPECT_GE(account["fiducials"], 6);
  EXPECT_GT(account["coverage"], 0.7);
  EXPECT_EQ(calibration.ground->sheet_thickness_m, 0.0001);
  EXPECT_EQ(calibration.ground->created.size(), 20u);
}

TEST_F(Ground, ACalibrationThatPutsThePlateElsewhereShows) {
  // The cameras above are a quarter of a millimetre too high: the sheet's sides do not fit.
  Calibration calibration = TrueCalibration(config_);
  for (const std::size_t c : {2, 3}) {
    Rigid3 world_from_cam = calibration.rig.cameras[c].cam_from_world.Inverse();
    world_from_cam.translation.z() += 0.00025;
    calibration.rig.cameras[c].cam_from_world = world_from_cam.Inverse();
  }
  EXPECT_THAT(ErrorOf([&] { AddGround(calibration, *dir_ / "sheet"); }),
              HasSubstr("mm thick between the cameras above and below"));
  EXPECT_FALSE(calibration.ground);
}

TEST_F(Ground, RefusesATakeWithoutTheSheetOrOfAnotherRig) {
  Calibration calibration = TrueCalibration(config_);
  testing_support::WriteDarkTake(*dir_ / "dark", config_, 1);
  EXPECT_THAT(ErrorOf([&] { AddGround(calibration, *dir_ / "dark"); }),
              testing::AllOf(HasSubstr("dark: ground: 0 points of the contact sheet were found"),
                             HasSubstr("lay the speckled sheet")));
  calibration.rig.rig_hash = "0000000000000000";
  EXPECT_THAT(ErrorOf([&] { AddGround(calibration, *dir_ / "sheet"); }), HasSubstr("another rig"));
}

}  // namespace
}  // namespace sole::app
