#include "sim/true_rig.h"

#include <cmath>
#include <filesystem>
#include <numbers>
#include <string>

#include <gtest/gtest.h>

#include "core/error.h"
#include "io/atomic_file.h"
#include "sim/scene.h"

namespace sole::sim {
namespace {

TEST(DrawTrueRig, StaysNearTheNominalRigAndFollowsTheSeed) {
  const RigConfig config = MakeDefaultRig(20);
  double largest_turn = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const TrueRig rig = DrawTrueRig(config, seed), again = DrawTrueRig(config, seed);
    EXPECT_EQ(rig.plate.index, again.plate.index);
    EXPECT_NEAR(rig.plate.thickness_m, config.plate.thickness_m, 0.0003);
    EXPECT_NEAR(rig.plate.index, 1.52, 0.005);
    ASSERT_EQ(rig.cameras.size(), config.cameras.size());
    for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
      const TrueCamera& camera = rig.cameras[i];
      EXPECT_EQ(camera.fx, again.cameras[i].fx);
      EXPECT_NEAR(camera.fx / config.cameras[i].focal_px, 1, 0.0101);
      EXPECT_LT((camera.Centre() - config.cameras[i].position_m).norm(), 0.003 * std::sqrt(3.0));
      const double turn = camera.cam_from_world.rotation.angularDistance(
          NominalCamFromWorld(config.cameras[i]).rotation);
      EXPECT_LT(turn, 1.2 * std::numbers::pi / 180);
      largest_turn = std::max(largest_turn, turn);
    }
    EXPECT_NE(rig.cameras[0].fx, DrawTrueRig(config, seed + 100).cameras[0].fx);
  }
  EXPECT_GT(largest_turn, 0.3 * std::numbers::pi / 180);
}

TEST(WriteTruthRig, HoldsPlateAndCameras) {
  const std::filesystem::path folder =
      std::filesystem::temp_directory_path() / "sole_true_rig_test";
  std::filesystem::remove_all(folder);
  const TrueRig rig = DrawTrueRig(MakeDefaultRig(), 7);
  WriteTruthRig(folder / "truth" / "rig.json", rig);
  const std::string text = io::ReadFile(folder / "truth" / "rig.json");
  EXPECT_NE(text.find("\"thickness_m\": 0.01"), std::string::npos);
  EXPECT_NE(text.find("\"serial\": \"SIM0004\""), std::string::npos);
  std::filesystem::remove_all(folder);
}

TEST(CalibrationPoses, KeepTheCubeInTheVolumeAndOffTheGlass) {
  const double edge = 0.10;
  const auto poses = CalibrationPoses(200, edge, 5);
  ASSERT_EQ(poses.size(), 200U);
  double steepest = 0;
  for (const Rigid3& pose : poses) {
    EXPECT_LT(std::abs(pose.translation.x()), 0.08);
    EXPECT_LT(std::abs(pose.translation.y()), 0.15);
    EXPECT_GE(pose.translation.z(), 0.075);
    EXPECT_LE(pose.translation.z(), 0.14);
    for (int i = 0; i < 8; ++i) {
      const Eigen::Vector3d corner(i & 1 ? 0.5 : -0.5, i & 2 ? 0.5 : -0.5, i & 4 ? 0.5 : -0.5);
      EXPECT_GT((pose * Eigen::Vector3d(edge * corner)).z(), 0.0039);
    }
    const double tilt = std::acos((pose.rotation * Eigen::Vector3d::UnitZ()).z());
    EXPECT_LT(tilt, 35.01 * std::numbers::pi / 180);
    steepest = std::max(steepest, tilt);
  }
  EXPECT_GT(steepest, 30 * std::numbers::pi / 180);
  EXPECT_EQ(CalibrationPoses(3, edge, 5)[2].translation, poses[2].translation);
}

}  // namespace
}  // namespace sole::sim
