#include "calib/pictures.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <random>

#include "core/error.h"
#include "io/image_file.h"
#include "io/image_folder.h"
#include "tests/calib/synthetic_rig.h"
#include "tests/support/error_matcher.h"

namespace sole::calib {
namespace {

using testing::HasSubstr;
using sole::testing_support::ErrorOf;

const Board kBoard = ParseBoard("chessboard:9x6:25mm");

/// Two cameras side by side and a board before them.
struct StereoScene {
  std::vector<ImageCamera> cameras{{"left", 640, 480}, {"right", 640, 480}};
  Rigid3 right_from_left{Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY())),
                         {-0.08, 0.002, 0.003}};
  Intrinsics lens;
  TakeObservations take;

  explicit StereoScene(int views, double noise_px, const Board& board = kBoard,
                       double true_scale = 1) {
    lens << 540, 542, 330, 236, -0.28, 0.09, 1e-3, -5e-4, 0;
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int v = 0; v < views; ++v) {
      auto& frame = take.frames.emplace_back(2);
      const Rigid3 tilt = testing_support::RandomTurn(random, 0.3, 0);
      const std::vector<Eigen::Vector3d> corners = BoardCorners(board);
      const Eigen::Vector3d middle = 0.5 * (corners.front() + corners.back());
      for (int i = 0; i < static_cast<int>(corners.size()); ++i) {
        const Eigen::Vector3d in_board =
            true_scale * (corners[static_cast<std::size_t>(i)] - middle);
        const Eigen::Vector3d in_left =
            tilt.rotation * in_board + Eigen::Vector3d(0.03 * (v % 3 - 1), 0.02 * (v % 2), 0.45);
        for (std::size_t c = 0; c < 2; ++c) {
          const Eigen::Vector3d in_cam = c == 0 ? in_left : right_from_left * in_left;
          const Eigen::Vector2d pixel = PixelFromPointInCam<double>(lens.data(), in_cam) +
                                        noise_px * Eigen::Vector2d(normal(random), normal(random));
          frame[c].target.push_back({i, pixel, 0.1});
        }
      }
    }
  }
};

TEST(CalibrateBoards, FindsTheStereoPair) {
  const StereoScene scene(14, 0.1);
  const BoardResult result = CalibrateBoards(scene.cameras, scene.take, kBoard);
  ASSERT_EQ(result.pairs.size(), 1u);
  EXPECT_EQ(result.pairs[0].views, 14);
  // Two coordinates of 0.1 px each.
  EXPECT_NEAR(result.pairs[0].rms_px, 0.141, 0.01);
  EXPECT_NEAR(result.pairs[0].epipolar_px, 0.141, 0.02);
  EXPECT_LT(result.pairs[0].square_rms_mm, 0.3);
  EXPECT_GT(result.pairs[0].square_rms_mm, 0.02);
  const Rig& rig = result.calibration.rig;
  const Rigid3 right_from_left = rig.cameras[1].cam_from_world * rig.cameras[0].cam_from_world.Inverse();
  EXPECT_LT((right_from_left.translation - scene.right_from_left.translation).norm(), 5e-4);
  EXPECT_LT(right_from_left.rotation.angularDistance(scene.right_from_left.rotation), 3e-3);
  EXPECT_NEAR(rig.cameras[1].intrinsics[0], 540, 2);
  EXPECT_EQ(rig.pairs[0].name, "left-right");
  EXPECT_NEAR(result.view_rms_px[3][1], 0.141, 0.04);
}

TEST(CalibrateBoards, SaysWhatIsMissing) {
  StereoScene few(4, 0.1);
  EXPECT_THAT(ErrorOf([&] { CalibrateBoards(few.cameras, few.take, kBoard); }),
              HasSubstr("camera left sees the whole chessboard in 4 of 4 pictures, needs 5"));
  StereoScene blind(10, 0.1);
  for (auto& frame : blind.take.frames) frame[1].target.clear();
  EXPECT_THAT(ErrorOf([&] { CalibrateBoards(blind.cameras, blind.take, kBoard); }),
              HasSubstr("camera right sees the whole chessboard in 0 of 10"));
  StereoScene apart(12, 0.1);
  for (std::size_t f = 0; f < 12; ++f) apart.take.frames[f][f % 2].target.clear();
  EXPECT_THAT(ErrorOf([&] { CalibrateBoards(apart.cameras, apart.take, kBoard); }),
              HasSubstr("camera right shares no picture of the board"));
}

TEST(CalibrateBoards, PartsOfAnAprilGridSuffice) {
  const Board grid = ParseBoard("aprilgrid:5x4:30mm:0.3");
  StereoScene scene(14, 0.05, grid);
  for (std::size_t f = 0; f < scene.take.frames.size(); ++f) {
    for (std::size_t c = 0; c < 2; ++c) {
      // Another part in every picture; two corners in one picture are in the wrong place.
      std::erase_if(scene.take.frames[f][c].target, [&](const PointObservation& o) {
        return (o.point % 10 / 2 + static_cast<int>(f)) % 5 < 2 ||
               (o.point / 20 + static_cast<int>(c)) % 3 == 1;
      });
      scene.take.frames[f][c].target[3].pixel.x() += f == 4 ? 9 : 0;
    }
  }
  // All corners of this one lie in one line.
  std::erase_if(scene.take.frames[9][0].target,
                [](const PointObservation& o) { return o.point >= 10; });
  const BoardResult result = CalibrateBoards(scene.cameras, scene.take, grid);
  EXPECT_TRUE(std::isnan(result.view_rms_px[9][0]));
  EXPECT_EQ(result.pairs.at(0).views, 13);
  EXPECT_GE(result.dropped, 2);
  EXPECT_LT(result.dropped, 10);
  EXPECT_NEAR(result.pairs[0].epipolar_px, 0.07, 0.03);
  const Rig& rig = result.calibration.rig;
  const Rigid3 right_from_left =
      rig.cameras[1].cam_from_world * rig.cameras[0].cam_from_world.Inverse();
  EXPECT_LT((right_from_left.translation - scene.right_from_left.translation).norm(), 1e-3);
  EXPECT_NEAR(rig.cameras[0].intrinsics[0], 540, 3);
}

TEST(CalibrateBoards, NamesTheCameraThatShowsTheBoardMirrored) {
  const Board board = ParseBoard("charuco:8x6:25mm:18mm");
  StereoScene scene(10, 0.05, board);
  for (auto& frame : scene.take.frames) {
    frame[1].target.clear();
    frame[1].mirrored_target = true;
  }
  EXPECT_THAT(ErrorOf([&] { CalibrateBoards(scene.cameras, scene.take, board); }),
              HasSubstr("camera right shows the board mirrored in 10 of 10 pictures"));
}

TEST(CalibrateBoards, AMirroredChessboardPairContradictsItself) {
  // A chessboard alone looks the same in a mirror: its corners are numbered from the other side.
  StereoScene scene(12, 0.05);
  for (auto& frame : scene.take.frames) {
    for (PointObservation& o : frame[1].target) {
      o.pixel.x() = 639 - o.pixel.x();
      o.point = o.point / 9 * 9 + 8 - o.point % 9;
    }
  }
  EXPECT_THAT(ErrorOf([&] { CalibrateBoards(scene.cameras, scene.take, kBoard); }),
              HasSubstr("the board's corners contradict each other"));
}

TEST(CalibrateBoards, PicturesThatDoNotBelongTogetherContradictEachOther) {
  StereoScene scene(12, 0.05);
  for (std::size_t f = 0; f + 1 < 12; ++f)
    std::swap(scene.take.frames[f][1], scene.take.frames[f + 1][1]);  // the next moment's
  EXPECT_THAT(ErrorOf([&] { CalibrateBoards(scene.cameras, scene.take, kBoard); }),
              HasSubstr("are pictures of one number taken at one moment"));
}

TEST(JudgeBoard, ASecondBoardTellsThatTheFirstHasAnotherSize) {
  const StereoScene scene(12, 0.05);
  const Rig rig = CalibrateBoards(scene.cameras, scene.take, kBoard).calibration.rig;
  const Board second = ParseBoard("charuco:6x5:30mm:22mm");
  const BoardScale right = JudgeBoard(rig, StereoScene(5, 0.05, second).take, second);
  EXPECT_EQ(right.lengths, 5 * 20 * 19 / 2);
  EXPECT_NEAR(right.scale, 1, 0.001);
  EXPECT_LT(right.rms_mm, 0.3);
  const BoardScale wrong = JudgeBoard(rig, StereoScene(5, 0.05, second, 1.02).take, second);
  EXPECT_NEAR(wrong.scale, 1.02, 0.001);
  EXPECT_GT(wrong.rms_mm, 1);
  EXPECT_EQ(JudgeBoard(rig, TakeObservations{}, second).lengths, 0);
}

TEST(DetectBoard, ChessboardsBeginAtTheSameEndHoweverTheBoardIsTurned) {
  ImageU8 image(440, 320, 255);
  for (int y = 0; y < 7; ++y) {
    for (int x = 0; x < 10; ++x) {
      if ((x + y) % 2 != 0) continue;
      for (int v = 0; v < 30; ++v) {
        for (int u = 0; u < 30; ++u) image.At(60 + 30 * x + u, 50 + 30 * y + v) = 20;
      }
    }
  }
  ImageU8 turned = image;
  std::reverse(turned.pixels.begin(), turned.pixels.end());
  const auto upright = DetectBoard(image, kBoard).target, half_turn = DetectBoard(turned, kBoard).target;
  ASSERT_EQ(upright.size(), 54u);
  ASSERT_EQ(half_turn.size(), 54u);
  for (std::size_t i = 0; i < 54; ++i) {
    const Eigen::Vector2d back(439 - half_turn[i].pixel.x(), 319 - half_turn[i].pixel.y());
    EXPECT_LT((back - upright[i].pixel).norm(), 0.1) << i;
  }
  const double x0 = upright[0].pixel.x(), y0 = upright[0].pixel.y();
  EXPECT_NEAR(std::min(std::abs(x0 - 89.5), std::abs(x0 - 329.5)), 0, 0.1);
  EXPECT_NEAR(std::min(std::abs(y0 - 79.5), std::abs(y0 - 229.5)), 0, 0.1);
}

/// Not part of the repository: samples/data of Debian's source package opencv.
TEST(CalibrateBoards, OpenCvSamplePairs) {
  const char* folder_name = std::getenv("SOLE_OPENCV_SAMPLES");
  if (!folder_name) {
    GTEST_SKIP() << "set SOLE_OPENCV_SAMPLES to a folder with left01.jpg to right14.jpg of "
                    "samples/data in `apt-get source opencv`";
  }
  const io::ImageFolder folder = io::ListImageFolder(folder_name);
  ASSERT_EQ(folder.cameras, (std::vector<std::string>{"left", "right"}));
  TakeObservations take;
  for (const auto& files : folder.files) {
    auto& frame = take.frames.emplace_back(2);
    for (std::size_t c = 0; c < 2; ++c) frame[c].target = DetectBoard(io::ReadImage(files[c]), kBoard).target;
  }
  const BoardResult result =
      CalibrateBoards({{"left", 640, 480}, {"right", 640, 480}}, take, kBoard);
  EXPECT_EQ(result.pairs.at(0).views, 13);
  EXPECT_LE(result.pairs[0].rms_px, 0.22);
  EXPECT_LE(result.pairs[0].epipolar_px, 0.30);
}

}  // namespace
}  // namespace sole::calib
