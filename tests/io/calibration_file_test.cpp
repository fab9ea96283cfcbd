#include "io/calibration_file.h"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/atomic_file.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

Calibration MakeCalibration() {
  Calibration calibration;
  calibration.created = "2026-01-02T03:04:05Z";
  calibration.rig.rig_hash = "0123456789abcdef";
  calibration.rig.plate = {0.0152, 1.517};
  for (int i = 0; i < 2; ++i) {
    Camera camera{"SIM000" + std::to_string(i + 1), 1624, 1236, Intrinsics::Random(), {}};
    camera.intrinsics.head<4>() << 3250.1 + i, 3251.3, 811.7, 617.2;
    camera.cam_from_world = {Eigen::Quaterniond::UnitRandom(), Eigen::Vector3d::Random()};
    calibration.rig.cameras.push_back(camera);
  }
  calibration.rig.pairs = {{"below", 0, 1}};
  calibration.stats = {.reprojection_rms_px = 0.11,
                       .camera_rms_px = {0.1, 0.12},
                       .camera_corners = {400, 500},
                       .heldout_rms_air_mm = 0.02,
                       .heldout_rms_glass_mm = std::nan(""),
                       .heldout_rms_across_mm = 0.03,
                       .heldout_max_mm = 0.07,
                       .heldout_points = 90,
                       .heldout_rejected = 2,
                       .ground_rms_mm = 0.01,
                       .poses_used = 30,
                       .poses_heldout = 6,
                       .pair_offset_mm = {0.004},
                       .pair_epipolar_px = {std::nan("")},
                       .failures = {"it \"fails\""}};
  calibration.covariance = Eigen::MatrixXd::Random(31, 31);
  return calibration;
}

TEST(Calibration, RoundTripsExactly) {
  const TempDir dir;
  const Calibration written = MakeCalibration();
  WriteCalibration(dir / "cal.json", written);
  const Calibration read = ReadCalibration(dir / "cal.json");
  EXPECT_EQ(read.created, written.created);
  EXPECT_EQ(read.rig.rig_hash, written.rig.rig_hash);
  EXPECT_EQ(read.rig.plate.thickness_m, 0.0152);
  EXPECT_EQ(read.rig.plate.index, 1.517);
  ASSERT_EQ(read.rig.cameras.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const Camera &a = written.rig.cameras[i], &b = read.rig.cameras[i];
    EXPECT_EQ(b.serial, a.serial);
    EXPECT_EQ(b.width, 1624);
    EXPECT_EQ(b.height, 1236);
    EXPECT_EQ(b.intrinsics, a.intrinsics);
    EXPECT_EQ(b.cam_from_world.rotation.coeffs(), a.cam_from_world.rotation.coeffs());
    EXPECT_EQ(b.cam_from_world.translation, a.cam_from_world.translation);
  }
  EXPECT_EQ(read.rig.pairs[0].name, "below");
  EXPECT_EQ(read.rig.pairs[0].right, 1);
  EXPECT_EQ(read.stats.camera_rms_px, written.stats.camera_rms_px);
  EXPECT_EQ(read.stats.camera_corners, written.stats.camera_corners);
  EXPECT_TRUE(std::isnan(read.stats.heldout_rms_glass_mm));
  EXPECT_EQ(read.stats.heldout_rms_across_mm, 0.03);
  EXPECT_EQ(read.stats.heldout_max_mm, 0.07);
  EXPECT_EQ(read.stats.heldout_points, 90);
  EXPECT_EQ(read.stats.heldout_rejected, 2);
  EXPECT_EQ(read.stats.pair_offset_mm, written.stats.pair_offset_mm);
  EXPECT_TRUE(std::isnan(read.stats.pair_epipolar_px.at(0)));
  EXPECT_EQ(read.stats.failures, written.stats.failures);
  EXPECT_EQ(read.stats.poses_heldout, 6);
  EXPECT_EQ(read.covariance, written.covariance);
}

TEST(Calibration, WorksWithoutACovariance) {
  const TempDir dir;
  Calibration calibration = MakeCalibration();
  calibration.covariance.resize(0, 0);
  WriteCalibration(dir / "cal.json", calibration);
  EXPECT_EQ(ReadCalibration(dir / "cal.json").covariance.size(), 0);
}

TEST(WriteCalibration, RefusesValuesThatAreNotFiniteAndWrongSizes) {
  const TempDir dir;
  Calibration calibration = MakeCalibration();
  calibration.rig.cameras[1].intrinsics[4] = std::numeric_limits<double>::infinity();
  EXPECT_THAT(ErrorOf([&] { WriteCalibration(dir / "c.json", calibration); }),
              HasSubstr("c.json: camera 'SIM0002' has a value"));
  calibration = MakeCalibration();
  calibration.covariance.resize(3, 3);
  EXPECT_THAT(ErrorOf([&] { WriteCalibration(dir / "c.json", calibration); }),
              HasSubstr("covariance must be finite and 31 x 31"));
}

TEST(ReadCalibration, NamesWhatIsWrong) {
  const TempDir dir;
  WriteCalibration(dir / "c.json", MakeCalibration());
  const std::string good = ReadFile(dir / "c.json");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    text.replace(at, from.size(), to);
    WriteStringAtomically(dir / "c.json", text);
    return ErrorOf([&] { ReadCalibration(dir / "c.json"); });
  };
  EXPECT_THAT(with("\"version\": 2", "\"version\": 3"),
              HasSubstr("c.json: format version 3 is unknown"));
  EXPECT_THAT(with("\"fx_px\"", "\"fx\""), HasSubstr("c.json: camera 0: key 'fx_px' is missing"));
  EXPECT_THAT(with("\"width\": 1624", "\"width\": 0"),
              HasSubstr("camera 0: width and height must be positive"));
  EXPECT_THAT(with("\"right\": 1", "\"right\": 2"),
              HasSubstr("pair 0: left and right must be two different cameras"));
  EXPECT_THAT(with("\"covariance\": [", "\"covariance\": [1.0,"),
              HasSubstr("must be a list of 961 numbers"));
  EXPECT_THAT(with("\"index\": 1.517", "\"index\": 0.1"), HasSubstr("plate needs"));
  EXPECT_THAT(with("sole-calibration", "sole-take"), HasSubstr("expected a calibration"));
  EXPECT_THAT(with("{", "{,"), HasSubstr("c.json: is not valid JSON"));
}

}  // namespace
}  // namespace sole::io
