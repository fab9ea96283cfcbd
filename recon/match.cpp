#include "recon/match.h"

#include <algorithm>
#include <array>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

namespace sole::recon {
namespace {

cv::Mat View(const ImageU8& image) {
  return {image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data())};
}
cv::Mat View(const ImageF& image) {
  return {image.height, image.width, CV_32F, const_cast<float*>(image.pixels.data())};
}

/// Rectified image. The raw image is smoothed first where the rectified one is coarser.
cv::Mat Resample(const ImageU8& raw, const Rectification& rectification,
                 const RectifiedView& view) {
  const double scale = 4 * rectification.focal_px / (2 * view.camera.intrinsics.head<2>().sum());
  cv::Mat smooth = View(raw);
  if (scale < 0.75) cv::GaussianBlur(smooth, smooth.clone(), cv::Size(0, 0), 0.35 / scale);
  cv::Mat rectified;
  cv::remap(smooth, rectified, View(view.map_x), View(view.map_y), cv::INTER_LINEAR,
            cv::BORDER_CONSTANT, cv::Scalar(0));
  return rectified;
}

/// Grey level below which a share of the pixels lies.
int Quantile(const std::array<std::size_t, 256>& histogram, std::size_t total, double share) {
  std::size_t below = 0;
  for (int level = 0; level < 256; ++level) {
    below += histogram[static_cast<std::size_t>(level)];
    if (static_cast<double>(below) >= share * static_cast<double>(total)) return level;
  }
  return 255;
}

}  // namespace

ImageF InitialDisparity(const ImageU8& left, const ImageU8& right,
                        const Rectification& rectification, const MatchOptions& options) {
  const cv::Mat rect_left = Resample(left, rectification, rectification.left);
  const cv::Mat rect_right = Resample(right, rectification, rectification.right);
  const int area = options.block_px * options.block_px;
  const auto matcher = cv::StereoSGBM::create(
      0, rectification.disparities, options.block_px, 4 * area, 24 * area, 1, 31,
      options.uniqueness, options.min_region_px, 2, cv::StereoSGBM::MODE_SGBM_3WAY);
  cv::Mat fixed;
  matcher->compute(rect_left, rect_right, fixed);
  ImageF disparity(rectification.width, rectification.height,
                   std::numeric_limits<float>::quiet_NaN());
  for (int y = 0; y < fixed.rows; ++y) {
    const auto* row = fixed.ptr<std::int16_t>(y);
    for (int x = 0; x < fixed.cols; ++x) {
      if (row[x] >= 0) disparity.At(x, y) = static_cast<float>(row[x]) / 16.0F;
    }
  }
  return disparity;
}

Foreground FindForeground(const ImageU8& image, const ForegroundOptions& options) {
  Foreground result;
  result.mask = ImageU8(image.width, image.height);
  std::array<std::size_t, 256> histogram{};
  for (const std::uint8_t level : image.pixels) ++histogram[level];
  const std::size_t total = image.pixels.size();
  const double background = Quantile(histogram, total, 0.10);
  const double bright = Quantile(histogram, total, 0.999);
  if (bright < options.dark_level) {
    result.problem = "dark";
    return result;
  }
  const double threshold =
      background + std::max(options.min_rise, options.relative_level * (bright - background));
  std::size_t lit = 0, saturated = 0;
  for (int level = 0; level < 256; ++level) {
    if (level > threshold) lit += histogram[static_cast<std::size_t>(level)];
    if (level >= options.saturated_level) saturated += histogram[static_cast<std::size_t>(level)];
  }
  if (static_cast<double>(saturated) >
          options.max_saturated * static_cast<double>(std::max<std::size_t>(lit, 1)) ||
      background >= options.saturated_level) {
    result.problem = "saturated";
    return result;
  }
  cv::Mat mask = View(result.mask);
  cv::threshold(View(image), mask, threshold, 255, cv::THRESH_BINARY);
  const int size = 2 * options.close_px + 1;
  const cv::Mat kernel = cv::getStructuringElement(cv::MORPH_RECT, {size, size});
  cv::Mat closed;
  cv::morphologyEx(mask, closed, cv::MORPH_CLOSE, kernel);
  closed.copyTo(mask);
  return result;
}

}  // namespace sole::recon
