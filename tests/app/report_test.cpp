// The report's pictures: which frame they show, and all of the foot, wherever on the plate it is.
#include "app/report.h"

#include <array>
#include <string_view>

#include <gtest/gtest.h>
#include <opencv2/imgcodecs.hpp>

#include "io/atomic_file.h"
#include "model/forward.h"
#include "tests/app/shipped_models.h"
#include "tests/app/small_take.h"
#include "tests/support/temp_dir.h"

namespace sole::app {
namespace {

std::vector<std::uint8_t> FromBase64(std::string_view text) {
  const std::string_view digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::vector<std::uint8_t> bytes;
  unsigned value = 0;
  int bits = 0;
  for (const char c : text) {
    if (c == '=') break;
    value = value << 6 | static_cast<unsigned>(digits.find(c));
    bits += 6;
    if (bits >= 8) bytes.push_back(static_cast<std::uint8_t>(value >> (bits -= 8)));
  }
  return bytes;
}

std::vector<cv::Mat> PngPictures(const std::string& html) {
  const std::string begin = "data:image/png;base64,";
  std::vector<cv::Mat> pictures;
  for (std::size_t at = 0; (at = html.find(begin, at)) != std::string::npos;) {
    at += begin.size();
    pictures.push_back(cv::imdecode(FromBase64(std::string_view(html).substr(at, html.find('"', at) - at)), cv::IMREAD_COLOR));
  }
  return pictures;
}

/// Pixels unlike the upper left one.
int Drawn(const cv::Mat& picture) {
  cv::Mat differs;
  cv::absdiff(picture, cv::Scalar(picture.at<cv::Vec3b>(0, 0)), differs);
  return cv::countNonZero(differs.reshape(1) > 0);
}

TEST(WriteReport, ShowsAllOfTheFootInTheFrameThatTouchesMost) {
  const testing_support::TempDir directory;
  const std::filesystem::path root = directory / "walk";
  testing_support::WriteDarkTake(root, testing_support::SmallRig(), 3);
  const io::TakePaths take{root};
  const model::FootModel& model = Models().right;
  const Eigen::Index n = model.NumVertices();
  FitSequence fit;
  fit.beta = fit.beta_sd = Eigen::VectorXd::Zero(model.NumBetas());
  io::ContactFile contact;
  for (int f = 0; f < 3; ++f) {
    FrameFit frame;
    frame.trigger = f + 1;
    frame.found = true;
    frame.verdict = "good";
    frame.theta = frame.theta_sd = Eigen::MatrixX3d::Zero(model.NumJoints(), 3);
    // In the first and the last frame far along the plate.
    frame.translation_m = {0.1, 0.25 * (f - 1) + 0.05, 0};
    const model::ModelParameters parameters{frame.theta, fit.beta, frame.translation_m, {}};
    frame.vertices_m = frame.registration_m = model::Forward(model, parameters).vertices_m;
    frame.registration_fine_m = model::Forward(model, parameters, model::Variant::kFine).vertices_m;
    frame.registration_sd_m = frame.vertex_sd_m = Eigen::VectorXd::Constant(n, 1e-5);
    fit.frames.push_back(frame);
    contact.triggers.push_back(f + 1);
    contact.ground.push_back({});
    const double probability = std::array{0.0, 0.2, 0.9}[static_cast<std::size_t>(f)];
    contact.contact.push_back({std::vector<std::uint8_t>(static_cast<std::size_t>(n), f == 2),
                               Eigen::VectorXd::Constant(n, probability), Eigen::VectorXd::Zero(n)});
  }
  io::WriteFit(take.Fit(), fit);
  io::WriteContact(take.Contact(), contact);
  WriteReport(directory / "report.html", root, Models(), {{"fit", {{"frames_fitted", 3}}}});
  const std::string html = io::ReadFile(directory / "report.html");
  EXPECT_NE(html.find("What the cameras saw, trigger 3<"), std::string::npos);
  EXPECT_NE(html.find("contact, trigger 3<"), std::string::npos);
  const std::vector<cv::Mat> pictures = PngPictures(html);
  ASSERT_EQ(pictures.size(), 3U);
  for (const cv::Mat& picture : pictures) {
    const cv::Rect inner(2, 2, picture.cols - 4, picture.rows - 4);
    EXPECT_GT(Drawn(picture(inner)), 20000);
    EXPECT_EQ(Drawn(picture), Drawn(picture(inner))) << "a foot cut off by the picture's edge";
  }
}

}  // namespace
}  // namespace sole::app
