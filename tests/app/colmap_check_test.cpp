// COLMAP, run as a program, finds a rig anew from its observations; how far it agrees is told.

#include "app/colmap_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <random>

#include <nlohmann/json.hpp>

#include "app/child_process.h"
#include "calib/calibrate.h"
#include "tests/calib/synthetic_rig.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

using calib::Agreement;
using calib::testing_support::MakeSyntheticRig;
using calib::testing_support::ObserveSynthetic;
using calib::testing_support::SyntheticRig;
using testing::HasSubstr;
using testing_support::ErrorOf;

/// The rig as it really is.
Rig TrueRig(const SyntheticRig& truth) {
  Rig rig;
  rig.plate = {truth.thickness_m, truth.index};
  for (std::size_t c = 0; c < truth.config.cameras.size(); ++c) {
    const CameraConfig& nominal = truth.config.cameras[c];
    Camera camera{nominal.serial, nominal.width, nominal.height, Intrinsics::Zero(), truth.cam_from_world[c]};
    camera.intrinsics.head<8>() = truth.lens[c];
    rig.cameras.push_back(camera);
  }
  return rig;
}

class ColmapCheckTest : public testing::Test {
 protected:
  void SetUp() override {
    if (FindProgram("colmap").empty()) GTEST_SKIP() << "colmap is not installed: run scripts/setup";
  }
};

void Print(const ColmapCheck& check) {
  const Agreement& a = check.agreement;
  std::printf("%d of %d images, target %.4f mm, centres %.4f mm, directions %.4f deg, views %.4f px, scale %+.6f\n",
              check.colmap.images_placed, check.colmap.images, check.colmap.target_rms_mm, a.centre_rms_mm, a.direction_rms_deg,
              a.view_rms_px, a.scale - 1);
}

std::size_t ColmapFolders() {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(std::filesystem::temp_directory_path()))
    count += entry.path().filename().string().find("colmap") != std::string::npos;
  return count;
}

TEST_F(ColmapCheckTest, AgreesWithOursAndWithTheTruth) {
  const SyntheticRig truth = MakeSyntheticRig(8, 12, 1);
  const calib::TakeObservations take = ObserveSynthetic(truth, 0.02, 1);
  const Calibration ours = calib::CalibrateFromObservations(truth.config, take);
  const testing_support::TempDir temporary;  // where COLMAP's files go, and nowhere else
  const char* old = std::getenv("TMPDIR");
  const std::string before = old ? old : "";
  ::setenv("TMPDIR", temporary.Path().c_str(), 1);
  const std::size_t elsewhere = ColmapFolders();
  ColmapCheck check = CheckWithColmap(truth.config, take, ours.rig);
  EXPECT_EQ(ColmapFolders(), elsewhere);
  old ? ::setenv("TMPDIR", before.c_str(), 1) : ::unsetenv("TMPDIR");
  EXPECT_TRUE(std::filesystem::is_empty(temporary.Path()));
  Print(check);
  EXPECT_EQ(check.agreement.cameras.size(), 6U);
  EXPECT_GE(check.colmap.images_placed, 0.8 * check.colmap.images);
  EXPECT_TRUE(check.colmap.in_world);
  EXPECT_LT(check.colmap.reprojection_rms_px, 0.022);
  EXPECT_LT(check.colmap.target_rms_mm, 0.005);
  EXPECT_LT(check.colmap.fiducial_rms_mm, 0.005);
  const auto expect_agreement = [](const Agreement& agreement) {
    EXPECT_LT(agreement.centre_rms_mm, 0.08);
    EXPECT_LT(agreement.direction_rms_deg, 0.02);
    EXPECT_LT(agreement.view_rms_px, 0.01);
    EXPECT_NEAR(agreement.scale, 1, 1e-4);
    for (const auto& c : agreement.cameras) EXPECT_TRUE(c.agrees) << c.serial;
  };
  expect_agreement(check.agreement);
  const Agreement with_truth = calib::CompareWithColmap(TrueRig(truth), check.colmap);
  expect_agreement(with_truth);
  EXPECT_EQ(CheckJson(check)["disagree"].size(), 0U);

  // A camera of ours that stands half a millimetre elsewhere is named, and no other.
  Rig moved = ours.rig;
  moved.cameras[4].cam_from_world.translation.x() += 0.0005;
  check.agreement = calib::CompareWithColmap(moved, check.colmap);
  Print(check);
  const nlohmann::json account = CheckJson(check);
  EXPECT_EQ(account["disagree"], nlohmann::json({"SIM0005"}));
  EXPECT_NEAR(account["cameras"][2]["centre_mm"].get<double>(), 0.5, 0.08);
  EXPECT_GT(account["cameras"][2]["view_px"].get<double>(), 2);
}

TEST_F(ColmapCheckTest, WrongCornersAreLeftOut) {
  const SyntheticRig truth = MakeSyntheticRig(8, 10, 2);
  calib::TakeObservations take = ObserveSynthetic(truth, 0.02, 2);
  std::mt19937_64 random(2);
  int wrong = 0;
  for (auto& frame : take.frames) {
    for (auto& view : frame) {
      for (auto& seen : view.target) {
        if (random() % 100 != 0) continue;
        seen.pixel += Eigen::Vector2d(random() % 2 == 0 ? 2 : -25, random() % 2 == 0 ? 1 : 10);
        ++wrong;
      }
    }
  }
  EXPECT_GT(wrong, 10);
  const ColmapCheck check = CheckWithColmap(truth.config, take, TrueRig(truth));
  Print(check);
  EXPECT_LT(check.colmap.reprojection_rms_px, 0.022);
  EXPECT_LT(check.agreement.centre_rms_mm, 0.15);
  EXPECT_LT(check.agreement.view_rms_px, 0.02);
}

TEST_F(ColmapCheckTest, TwoCamerasInAirSuffice) {
  const SyntheticRig truth = MakeSyntheticRig(4, 20, 2);
  const calib::TakeObservations take = ObserveSynthetic(truth, 0.02, 2);
  const ColmapCheck check = CheckWithColmap(truth.config, take, TrueRig(truth), {.threads = 1});
  Print(check);
  EXPECT_EQ(check.agreement.cameras.size(), 2U);
  EXPECT_LT(check.agreement.view_rms_px, 0.02);
  EXPECT_LT(check.agreement.centre_rms_mm, 0.4);
  EXPECT_NEAR(check.agreement.scale, 1, 1e-3);
}

TEST_F(ColmapCheckTest, CalibratesARigInAirAlone) {
  SyntheticRig truth = MakeSyntheticRig(8, 14, 3);
  const auto drop = [](auto& list, int count) { list.erase(list.begin(), list.begin() + count); };
  drop(truth.config.cameras, 2);
  drop(truth.config.pairs, 1);
  drop(truth.cam_from_world, 2);
  drop(truth.lens, 2);
  const calib::TakeObservations take = ObserveSynthetic(truth, 0.02, 3);
  const Calibration calibration = CalibrateWithColmap(truth.config, take, {});
  EXPECT_THAT(calibration.stats.failures, testing::IsEmpty());
  EXPECT_LT(calibration.stats.heldout_rms_air_mm, 0.02);
  for (std::size_t c = 0; c < 6; ++c) {
    const double off_mm = 1000 * (calibration.rig.cameras[c].CentreInWorld() - truth.Centre(c)).norm();
    EXPECT_LT(off_mm, 0.15) << c;  // in the world frame, which the fiducials give
  }
}

TEST_F(ColmapCheckTest, SaysWhatIsMissing) {
  const SyntheticRig truth = MakeSyntheticRig(4, 6, 4);
  calib::TakeObservations take = ObserveSynthetic(truth, 0.02, 4);
  EXPECT_THAT(ErrorOf([&] { FindRigWithColmap(truth.config, take, {.timeout_s = 1e-4}); }), HasSubstr("took longer than"));
  for (auto& frame : take.frames) {  // one face only: nothing to begin with
    for (auto& view : frame) std::erase_if(view.target, [&](const auto& seen) { return seen.point / 16 != view.target[0].point / 16; });
  }
  EXPECT_THAT(ErrorOf([&] { FindRigWithColmap(truth.config, take); }), testing::AnyOf(HasSubstr("COLMAP"), HasSubstr("colmap")));
}

}  // namespace
}  // namespace sole::app
