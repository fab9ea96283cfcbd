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

TEST(Calibration, GroundRoundTripsExactly) {
  const TempDir dir;
  Calibration written = MakeCalibration();
  WriteCalibration(dir / "without.json", written);
  EXPECT_FALSE(ReadCalibration(dir / "without.json").ground);
  written.ground = GroundSurface{.plane = {1e-5, 1.0 / 3e4, -2e-5},
                                 .first_node_m = {-0.09, -1.0 / 6},
                                 .spacing_m = 0.02,
                                 .nodes_x = 3,
                                 .nodes_y = 2,
                                 .residual_m = {1e-6, 2e-6, 3e-6, 4e-6, 5e-6, 1.0 / 7e5},
                                 .sigma_m = {1e-7, 1e-7, 1e-7, 2e-7, 2e-7, 3e-7},
                                 .marks = {{204, {0.1, 0.2, 1.0 / 3e5}, 2e-6}},
                                 .rms_m = 1.5e-5,
                                 .points = 1234,
                                 .sheet_thickness_m = 0.0001,
                                 .created = "2026-01-02T03:04:06Z"};
  WriteCalibration(dir / "cal.json", written);
  const auto read = ReadCalibration(dir / "cal.json").ground;
  ASSERT_TRUE(read);
  EXPECT_EQ(read->plane.offset_m, 1e-5);
  EXPECT_EQ(read->plane.slope_x, 1.0 / 3e4);
  EXPECT_EQ(read->plane.slope_y, -2e-5);
  EXPECT_EQ(read->first_node_m, written.ground->first_node_m);
  EXPECT_EQ(read->spacing_m, 0.02);
  EXPECT_EQ(read->nodes_x, 3);
  EXPECT_EQ(read->nodes_y, 2);
  EXPECT_EQ(read->residual_m, written.ground->residual_m);
  EXPECT_EQ(read->sigma_m, written.ground->sigma_m);
  ASSERT_EQ(read->marks.size(), 1U);
  EXPECT_EQ(read->marks[0].id, 204);
  EXPECT_EQ(read->marks[0].point_m, written.ground->marks[0].point_m);
  EXPECT_EQ(read->marks[0].sigma_m, 2e-6);
  EXPECT_EQ(read->rms_m, 1.5e-5);
  EXPECT_EQ(read->points, 1234);
  EXPECT_EQ(read->sheet_thickness_m, 0.0001);
  EXPECT_EQ(read->created, "2026-01-02T03:04:06Z");
}

TEST(ReadCalibration, FilesOfEarlierVersionsHaveNoGround) {
  const TempDir dir;
  WriteCalibration(dir / "c.json", MakeCalibration());
  std::string text = ReadFile(dir / "c.json");
  text.replace(text.find("\"version\": 3"), 12, "\"version\": 2");
  WriteStringAtomically(dir / "c.json", text);
  const Calibration read = ReadCalibration(dir / "c.json");
  EXPECT_FALSE(read.ground);
  EXPECT_EQ(read.stats.heldout_points, 90);
}

TEST(ReadCalibration, ChecksTheGroundsGrid) {
  const TempDir dir;
  Calibration calibration = MakeCalibration();
  GroundSurface& ground = calibration.ground.emplace();
  ground.spacing_m = 0.02;
  ground.nodes_x = ground.nodes_y = 2;
  ground.residual_m = ground.sigma_m = {0, 0, 0, 0};
  WriteCalibration(dir / "c.json", calibration);
  const std::string good = ReadFile(dir / "c.json");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string text = good;
    text.replace(text.find(from), from.size(), to);
    WriteStringAtomically(dir / "c.json", text);
    return ErrorOf([&] { ReadCalibration(dir / "c.json"); });
  };
  EXPECT_THAT(with("\"nodes_x\": 2", "\"nodes_x\": 3"),
              HasSubstr("ground: key 'residual_m' must be a list of 6 numbers"));
  EXPECT_THAT(with("\"nodes_x\": 2", "\"nodes_x\": -2"), HasSubstr("two nodes or more"));
  EXPECT_THAT(with("\"nodes_x\": 2", "\"nodes_x\": 2000000000"), HasSubstr("two nodes or more"));
  EXPECT_THAT(with("\"spacing_m\": 0.02", "\"spacing_m\": 0"), HasSubstr("spacing_m above 0"));
  EXPECT_THAT(with("\"offset_m\"", "\"height_m\""), HasSubstr("key 'offset_m' is missing"));
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
  EXPECT_THAT(with("\"version\": 3", "\"version\": 4"),
              HasSubstr("c.json: format version 4 is unknown"));
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
