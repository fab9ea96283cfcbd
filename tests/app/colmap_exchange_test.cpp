// Calibrations to COLMAP's models and back, through COLMAP's own converter.

#include "app/colmap_exchange.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "app/child_process.h"
#include "io/atomic_file.h"
#include "io/colmap_model.h"
#include "tests/app/run_program.h"
#include "tests/app/small_take.h"
#include "tests/support/temp_dir.h"

namespace sole {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing_support::NominalCalibration;
using testing_support::ProgramResult;
using testing_support::RunSole;

class ColmapExchange : public testing::Test {
 protected:
  ColmapExchange() {
    for (std::size_t c = 0; c < calibration.rig.cameras.size(); ++c) {
      Camera& camera = calibration.rig.cameras[c];
      camera.intrinsics.tail<5>() << -0.08, 0.1, 2e-4, -3e-4, 0.01 * static_cast<double>(c);
      camera.cam_from_world.translation.x() += 0.001 * static_cast<double>(c + 1);
    }
    calibration.rig.cameras[3].intrinsics.tail<5>().setZero();  // COLMAP's PINHOLE
    calibration.rig.plate = {0.0151, config.plate.index};
    io::WriteCalibration(folder / "cal.json", calibration);
    io::WriteRigFile(folder / "rig.toml", config);
  }
  std::string Path(const std::string& name) const { return (folder / name).string(); }
  ProgramResult Import(const std::string& model, const std::string& options = "") const {
    return RunSole("calibrate import " + Path(model) + " --rig " + Path("rig.toml") + " --out " + Path("new.json") + options);
  }
  void ExpectRefused(const io::ColmapModel& model, const std::string& part) {
    io::WriteColmapModel(folder / "model", model);
    const ProgramResult result = Import("model");
    EXPECT_EQ(result.status, 1) << result.output;
    EXPECT_EQ(result.ErrorLines(), 1) << result.output;
    EXPECT_THAT(result.output, HasSubstr(part));
    EXPECT_FALSE(fs::exists(folder / "new.json"));
  }
  io::ColmapModel Model() const {
    std::vector<io::ColmapView> views;
    for (const Camera& camera : calibration.rig.cameras) views.push_back({camera, camera.serial + "/000001.png"});
    return io::ModelOfViews(views);
  }

  testing_support::TempDir folder;
  RigConfig config = testing_support::SmallRig();
  Calibration calibration = NominalCalibration(config);
};

TEST_F(ColmapExchange, RoundTripThroughTheConverter) {
  const ProgramResult out = RunSole("calibrate export " + Path("cal.json") + " --to colmap --out " + Path("text"));
  ASSERT_EQ(out.status, 0) << out.output;
  EXPECT_THAT(out.output, HasSubstr("2 camera(s) below the glass"));
  const fs::path colmap = app::FindProgram("colmap");
  if (colmap.empty()) GTEST_SKIP() << "colmap is not installed: run scripts/setup";
  for (const char* sub : {"binary", "back"}) fs::create_directory(folder / sub);
  const auto convert = [&](const char* from, const char* to, const char* type) {
    return app::RunChild(colmap, {"model_converter", "--input_path", Path(from), "--output_path", Path(to), "--output_type", type},
                         {.log = folder / "log", .environment = {"QT_QPA_PLATFORM=offscreen", "TMPDIR=" + folder.Path().string()}});
  };
  ASSERT_EQ(convert("text", "binary", "BIN"), 0);
  EXPECT_THAT(Import("binary").output, HasSubstr("model_converter --output_type TXT"));
  ASSERT_EQ(convert("binary", "back", "TXT"), 0);
  const ProgramResult in = Import("back", " --plate " + Path("cal.json"));
  ASSERT_EQ(in.status, 0) << in.output;
  const Calibration read = io::ReadCalibration(folder / "new.json");
  ASSERT_EQ(read.rig.cameras.size(), calibration.rig.cameras.size());
  for (std::size_t c = 0; c < read.rig.cameras.size(); ++c) {
    const Camera &a = read.rig.cameras[c], &b = calibration.rig.cameras[c];
    EXPECT_EQ(a.serial, b.serial);
    EXPECT_EQ(a.width, b.width);
    EXPECT_LT((a.intrinsics - b.intrinsics).cwiseAbs().maxCoeff(), 1e-9);
    EXPECT_LT((a.CentreInWorld() - b.CentreInWorld()).norm(), 1e-12);
    EXPECT_LT(a.cam_from_world.rotation.angularDistance(b.cam_from_world.rotation), 1e-7);
  }
  EXPECT_EQ(read.rig.plate.thickness_m, 0.0151);
  EXPECT_EQ(read.rig.rig_hash, calibration.rig.rig_hash);
  ASSERT_EQ(read.rig.pairs.size(), 2U);
  EXPECT_EQ(read.rig.pairs[1].right, 3);
  EXPECT_TRUE(std::isnan(read.stats.heldout_rms_air_mm));  // not measured, not zero
}

TEST_F(ColmapExchange, TellsResidualsAndLeavesOtherImagesOut) {
  io::ColmapModel model = Model();
  model.images.push_back({"holiday.jpg", 0, {}, {}});
  model.points = {{{0.01, 0.02, 0.03}}, {{-0.01, 0, 0.05}}};
  const Camera& camera = calibration.rig.cameras[2];
  for (int p = 0; p < 2; ++p) {
    const Eigen::Vector3d in_cam = camera.cam_from_world * model.points[static_cast<std::size_t>(p)].point_m;
    const Eigen::Vector2d pixel = PixelFromPointInCam<double>(camera.intrinsics.data(), in_cam);
    model.images[2].pixels.push_back({pixel + Eigen::Vector2d(0.3, -0.4), p});
  }
  io::WriteColmapModel(folder / "model", model);
  const app::ImportedCalibration read = app::ImportCalibrationFromColmap(folder / "model", config);
  EXPECT_THAT(read.ignored, ElementsAre("holiday.jpg"));
  EXPECT_NEAR(read.calibration.stats.camera_rms_px[2], 0.5 / std::sqrt(2), 1e-6);
  EXPECT_NEAR(read.calibration.stats.reprojection_rms_px, 0.5 / std::sqrt(2), 1e-6);
  EXPECT_TRUE(std::isnan(read.calibration.stats.camera_rms_px[0]));
  EXPECT_EQ(read.calibration.rig.plate.thickness_m, config.plate.thickness_m);
}

TEST_F(ColmapExchange, RefusesWhatIsNoModelOfTheRig) {
  EXPECT_EQ(RunSole("calibrate export " + Path("cal.json") + " --to bundler --out " + Path("x")).status, 2);
  EXPECT_FALSE(fs::exists(folder / "x"));
  EXPECT_THAT(Import("none").output, HasSubstr("cannot read " + Path("none/cameras.txt")));
  io::ColmapModel model = Model();
  model.images.pop_back();
  ExpectRefused(model, "has no image of camera SIM0004; name it SIM0004.png");
  model = Model();
  model.images.push_back(model.images[1]);
  model.images.back().name = "SIM0002/000002.png";
  ExpectRefused(model, "camera SIM0002 has several images");
  model = Model();
  model.cameras[0].width = 161;
  ExpectRefused(model, "camera SIM0001 takes images of 161x120, the rig file says 160x120");
  model = Model();
  for (io::ColmapImage& image : model.images) image.cam_from_world.translation *= 1000;  // millimetres
  ExpectRefused(model, "m from where the rig file has it");
  io::WriteColmapModel(folder / "model", Model());
  Calibration other = calibration;
  other.rig.rig_hash = "0123456789abcdef";
  io::WriteCalibration(folder / "other.json", other);
  EXPECT_THAT(Import("model", " --plate " + Path("other.json")).output, HasSubstr("belongs to another rig"));
  EXPECT_FALSE(fs::exists(folder / "new.json"));
}

}  // namespace
}  // namespace sole
