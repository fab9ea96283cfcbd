// `sole match` as a user runs it: every kind of image file, and what it says to bad ones.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "io/atomic_file.h"
#include "io/image_file.h"
#include "tests/app/run_program.h"
#include "tests/app/small_take.h"
#include "tests/support/temp_dir.h"

namespace sole {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing_support::ProgramResult;
using testing_support::RunSole;
using testing_support::TempDir;

constexpr double kShift = 11.4;  // disparity of the test pair

/// Smooth random texture, levels 0 to 1, and itself moved left by kShift.
std::pair<cv::Mat, cv::Mat> MakePair() {
  cv::Mat left(120, 220, CV_32F);
  cv::RNG random(7);
  random.fill(left, cv::RNG::UNIFORM, 0, 1);
  cv::GaussianBlur(left, left, {0, 0}, 1.6);
  cv::normalize(left, left, 0.1, 0.9, cv::NORM_MINMAX);
  cv::Mat right;
  const cv::Mat move = (cv::Mat_<double>(2, 3) << 1, 0, -kShift, 0, 1, 0);
  cv::warpAffine(left, right, move, left.size(), cv::INTER_LANCZOS4, cv::BORDER_REFLECT);
  cv::min(cv::max(right, 0), 1, right);
  return {left, right};
}

cv::Mat As(const cv::Mat& levels, int depth, double white) {
  cv::Mat result;
  levels.convertTo(result, depth, white);
  return result;
}

void Write(const fs::path& path, const cv::Mat& image) {
  if (path.extension() == ".pfm") {
    ImageF copy(image.cols, image.rows);
    for (int y = 0; y < image.rows; ++y) std::copy_n(image.ptr<float>(y), image.cols, copy.Row(y).begin());
    io::WriteFloatImage(path, copy);
  } else {
    ASSERT_TRUE(cv::imwrite(path.string(), image));
  }
}

class Match : public testing::Test {
 protected:
  ProgramResult Run(const std::string& extension, int depth, double white, const std::string& out) const {
    Write(directory / ("left" + extension), As(pair.first, depth, white));
    Write(directory / ("right" + extension), As(pair.second, depth, white));
    return RunSole("match " + Path("left" + extension) + " " + Path("right" + extension) + " --out " + Path(out));
  }
  std::string Path(const std::string& name) const { return (directory / name).string(); }

  TempDir directory;
  std::pair<cv::Mat, cv::Mat> pair = MakePair();
};

struct Deviation {
  int known = 0;
  double rms_px = 0;
};

Deviation FromShift(const cv::Mat& disparity) {
  Deviation result;
  for (int y = 0; y < disparity.rows; ++y) {
    for (int x = 0; x < disparity.cols; ++x) {
      const double d = static_cast<double>(disparity.at<float>(y, x));
      if (!std::isfinite(d)) continue;
      ++result.known;
      result.rms_px += (d - kShift) * (d - kShift);
    }
  }
  result.rms_px = std::sqrt(result.rms_px / result.known);
  return result;
}

TEST_F(Match, EveryDepthAndFormatGivesTheSameDisparity) {
  struct Kind {
    const char* extension;
    int depth;
    double white;
  };
  for (const Kind& kind : {Kind{".png", CV_8U, 255}, Kind{".png", CV_16U, 4095}, Kind{".png", CV_16U, 65535},
                           Kind{".tiff", CV_8U, 255}, Kind{".tiff", CV_16U, 65535}, Kind{".tiff", CV_32F, 1},
                           Kind{".pfm", CV_32F, 1}, Kind{".pfm", CV_32F, 255}}) {
    const ProgramResult result = Run(kind.extension, kind.depth, kind.white, "disparity.tiff");
    ASSERT_EQ(result.status, 0) << result.output;
    const Deviation d = FromShift(cv::imread(Path("disparity.tiff"), cv::IMREAD_UNCHANGED));
    EXPECT_GT(d.known, 0.7 * 120 * 220) << kind.extension << kind.white;
    EXPECT_LT(d.rms_px, 0.01) << kind.extension << kind.white;
  }
}

TEST_F(Match, TiffAndPfmHoldTheSame) {
  ASSERT_EQ(Run(".png", CV_8U, 255, "disparity.pfm").status, 0);
  ASSERT_EQ(Run(".png", CV_8U, 255, "disparity.tif").status, 0);
  const cv::Mat tiff = cv::imread(Path("disparity.tif"), cv::IMREAD_UNCHANGED);
  const cv::Mat pfm = cv::imread(Path("disparity.pfm"), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(tiff.type(), CV_32F);
  ASSERT_EQ(tiff.size(), pfm.size());
  int unknown = 0;
  for (int y = 0; y < tiff.rows; ++y) {
    for (int x = 0; x < tiff.cols; ++x) {
      if (std::isnan(tiff.at<float>(y, x))) {
        ++unknown;
        EXPECT_TRUE(std::isinf(pfm.at<float>(y, x)));
      } else {
        EXPECT_EQ(tiff.at<float>(y, x), pfm.at<float>(y, x));
      }
    }
  }
  EXPECT_GT(unknown, 0);
}

TEST_F(Match, PlainHelpAndOneLineErrors) {
  const ProgramResult help = RunSole("match --help");
  EXPECT_EQ(help.status, 0);
  EXPECT_THAT(help.output, HasSubstr("Example: sole match left.png right.png --out disparity.tiff"));
  EXPECT_EQ(RunSole("match a.png b.png --out d.tiff --points p.csv").status, 2);  // needs --calibration

  Write(directory / "left.png", As(pair.first, CV_8U, 255));
  Write(directory / "small.png", As(pair.first, CV_8U, 255).rowRange(0, 100));
  io::WriteStringAtomically(directory / "text.png", "not an image");
  io::WriteStringAtomically(directory / "torn.pfm", "Pf\n220 120\n-1.0\n1234");
  io::WriteStringAtomically(directory / "points.csv", "x_px,y_px\n30,abc\n");
  io::WriteCalibration(directory / "rig.json", testing_support::NominalCalibration(testing_support::SmallRig()));
  const std::string left = Path("left.png") + " ", calibrated = " --calibration " + Path("rig.json") + " --points ";
  const std::vector<std::pair<std::string, std::string>> cases{
      {left + Path("small.png") + " --out " + Path("d.tiff"), "220 x 120 pixels, the right one 220 x 100"},
      {left + Path("text.png") + " --out " + Path("d.tiff"), "text.png: is not an image"},
      {left + Path("torn.pfm") + " --out " + Path("d.tiff"), "torn.pfm: is 20 bytes long"},
      {left + Path("none.png") + " --out " + Path("d.tiff"), "none.png"},
      {left + left + "--out " + Path("d.jpg"), "extension '.jpg': use .tiff or .pfm"},
      {left + left + "--window 8 --out " + Path("d.tiff"), "odd number of pixels from 5 to 31, not 8"},
      {left + left + "--out " + Path("m.csv") + calibrated + Path("points.csv"), "--pair"},
      {left + left + "--pair left-right --out " + Path("m.csv") + calibrated + Path("points.csv"), "has no pair"},
      {left + left + "--out " + Path("m.txt") + calibrated + Path("points.csv"), ".csv"}};
  for (const auto& [arguments, expected] : cases) {
    const ProgramResult result = RunSole("match " + arguments);
    EXPECT_EQ(result.status, 1) << result.output;
    EXPECT_EQ(result.ErrorLines(), 1) << result.output;
    EXPECT_THAT(result.output, HasSubstr(expected));
  }
  EXPECT_FALSE(fs::exists(directory / "d.tiff"));
  EXPECT_FALSE(fs::exists(directory / "m.csv"));
}

}  // namespace
}  // namespace sole
