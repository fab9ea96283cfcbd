#include "app/calibrate_images.h"

#include <random>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/targets.h"
#include "io/atomic_file.h"
#include "io/calibration_file.h"
#include "io/image_file.h"
#include "tests/calib/photograph.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

const char* const kGrid = "aprilgrid:4x3:36mm:0.3";
const char* const kCharuco = "charuco:8x6:25mm:19mm:5X5_250";

constexpr int kWidth = 480, kHeight = 360;
constexpr double kFocal_px = 420;
/// Right camera: 80 mm to the right and turned towards the left one's view.
const Rigid3 kRightFromLeft{Eigen::Quaterniond(Eigen::AngleAxisd(0.12, Eigen::Vector3d::UnitY())),
                            {-0.08, 0, 0}};

/// Photographs of a printed board in `count` poses, which often shows in part, by two pinhole cameras, as
/// FOLDER/left/01.png and so on; `first` numbers them.
void TakePictures(const std::filesystem::path& folder, const char* target, int count, int first = 1) {
  const calib::PrintedSheet sheet = calib::DrawBoard(calib::ParseBoard(target));
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  const Eigen::Matrix3d lens{{kFocal_px, 0, 243}, {0, kFocal_px, 176}, {0, 0, 1}};
  for (const char* camera : {"left", "right"}) io::MakeDirectory(folder / camera);
  for (int i = 0; i < count; ++i) {
    const Eigen::AngleAxisd turn(0.5 * unit(random), Eigen::Vector3d::UnitZ());
    const Eigen::AngleAxisd tilt(0.3 + 0.3 * unit(random),
                                 Eigen::Vector3d(unit(random), unit(random), 0).normalized());
    Rigid3 left_from_page{Eigen::Quaterniond(tilt * turn),
                          Eigen::Vector3d(0.04 + 0.05 * unit(random), 0.05 * unit(random), 0.36 + 0.06 * unit(random))};
    left_from_page.translation -=
        left_from_page.rotation * Eigen::Vector3d(0.5 * sheet.page.width_m, 0.5 * sheet.page.height_m, 0);
    for (const bool right : {false, true}) {
      const Rigid3 cam_from_page = right ? kRightFromLeft * left_from_page : left_from_page;
      Eigen::Matrix3d image_from_page;
      const Eigen::Matrix3d rotation = cam_from_page.rotation.toRotationMatrix();
      image_from_page << rotation.col(0), rotation.col(1), cam_from_page.translation;
      const Eigen::Matrix3d page_from_image = (lens * image_from_page).inverse();
      const ImageU8 image = calib::testing_support::Photograph(
          sheet.page, kWidth, kHeight, [&](const Eigen::Vector2d& p) {
            return Eigen::Vector2d((page_from_image * p.homogeneous()).hnormalized());
          });
      io::WriteImage(folder / (right ? "right" : "left") / fmt::format("{:02}.png", first + i), image);
    }
  }
}

void ExpectPair(const Calibration& calibration) {
  ASSERT_EQ(calibration.rig.cameras.size(), 2u);
  const Rigid3 right_from_left = calibration.rig.cameras[1].cam_from_world * calibration.rig.cameras[0].cam_from_world.Inverse();
  EXPECT_LT((right_from_left.translation - kRightFromLeft.translation).norm(), 0.001);
  EXPECT_LT(right_from_left.rotation.angularDistance(kRightFromLeft.rotation), 0.003);
  for (const Camera& camera : calibration.rig.cameras) EXPECT_NEAR(camera.intrinsics[0], kFocal_px, 3);
}

/// Ten pairs of pictures of an AprilGrid and three of a ChArUco board, taken once.
class Images : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    dir_ = new TempDir;
    TakePictures(*dir_ / "pictures", kGrid, 10);
    TakePictures(*dir_ / "pictures", kCharuco, 7, 11);
  }
  static void TearDownTestSuite() { delete dir_; }
  static TempDir* dir_;
};
TempDir* Images::dir_ = nullptr;

TEST_F(Images, AnAprilGridCalibratesAndACharucoBoardAgrees) {
  const auto account = CalibrateImages(*dir_ / "pictures", kGrid, kCharuco, *dir_ / "a.json");
  ExpectPair(io::ReadCalibration(*dir_ / "a.json"));
  EXPECT_LT(account["pairs"]["left-right"]["stereo_rms_px"], 0.1);
  EXPECT_GE(account["pairs"]["left-right"]["views"], 8);
  EXPECT_LT(account["pairs"]["left-right"]["square_rms_mm"], 0.2);
  EXPECT_LT(account["view_rms_px"]["right/03.png"], 0.1);
  EXPECT_NEAR(account["judge"]["scale"], 1, 0.001);
  EXPECT_LT(account["judge"]["rms_mm"], 0.2);
}

TEST_F(Images, ACharucoBoardCalibrates) {
  CalibrateImages(*dir_ / "pictures", kCharuco, "", *dir_ / "c.json");
  ExpectPair(io::ReadCalibration(*dir_ / "c.json"));
}

TEST_F(Images, AWrongSizeIsCaughtByTheOtherBoard) {
  EXPECT_THAT(ErrorOf([&] { CalibrateImages(*dir_ / "pictures", "aprilgrid:4x3:35mm:0.3", kCharuco, *dir_ / "w.json"); }),
              testing::AllOf(HasSubstr("the boards disagree about their size: by aprilgrid:4x3:35mm:0.3"),
                             HasSubstr("are 2.8"), HasSubstr("% too short")));
  EXPECT_FALSE(std::filesystem::exists(*dir_ / "w.json"));
}

TEST_F(Images, SaysWhatIsWrongWithThePictures) {
  const auto error = [&](const std::string& folder, const std::string& target) {
    return ErrorOf([&] { CalibrateImages(*dir_ / folder, target, "", *dir_ / "e.json"); });
  };
  EXPECT_THAT(error("pictures", "charuco:8x6:25mm:19mm:4X4_50"),
              HasSubstr("camera left sees enough of the board in 0 of 17 pictures, needs 5; check the numbers in --target"));
  EXPECT_THAT(error("pictures", "circles:3x3:1mm"), HasSubstr("give chessboard:COLUMNSxROWS:SQUARE"));

  std::filesystem::copy(*dir_ / "pictures", *dir_ / "flipped", std::filesystem::copy_options::recursive);
  for (const auto& file : std::filesystem::directory_iterator(*dir_ / "flipped" / "right")) {
    ImageU8 image = io::ReadImage(file.path());
    for (int y = 0; y < image.height; ++y) std::reverse(&image.At(0, y), &image.At(0, y) + image.width);
    io::WriteImage(file.path(), image);
  }
  EXPECT_THAT(error("flipped", kGrid), HasSubstr("camera right shows the board mirrored in"));

  io::WriteImage(*dir_ / "flipped" / "left" / "04.png", ImageU8(240, 180, 90));
  EXPECT_THAT(error("flipped", kGrid), testing::AllOf(HasSubstr("04.png: is 240x180, but 01.png of the same camera 480x360")));
  EXPECT_FALSE(std::filesystem::exists(*dir_ / "e.json"));
}

}  // namespace
}  // namespace sole::app
