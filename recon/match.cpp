#include "recon/match.h"

#include <algorithm>
#include <array>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"

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

/// OpenCV's three-way semi-global matching; NaN where there is no disparity. Returns `width` columns
/// from `first_column`.
ImageF SemiGlobal(const cv::Mat& left, const cv::Mat& right, int min_disparity, int disparities,
                  const MatchOptions& options, int first_column, int width) {
  const int area = options.block_px * options.block_px;
  const auto matcher = cv::StereoSGBM::create(
      min_disparity, disparities, options.block_px, 4 * area, 24 * area, 1, 31, options.uniqueness,
      options.min_region_px, 2, cv::StereoSGBM::MODE_SGBM_3WAY);
  cv::Mat fixed;
  matcher->compute(left, right, fixed);
  ImageF disparity(width, left.rows, std::numeric_limits<float>::quiet_NaN());
  for (int y = 0; y < fixed.rows; ++y) {
    const auto* row = fixed.ptr<std::int16_t>(y) + first_column;
    for (int x = 0; x < width; ++x) {
      if (row[x] >= 16 * min_disparity) disparity.At(x, y) = static_cast<float>(row[x]) / 16.0F;
    }
  }
  return disparity;
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
  return SemiGlobal(Resample(left, rectification, rectification.left),
                    Resample(right, rectification, rectification.right), 0,
                    rectification.disparities, options, 0, rectification.width);
}

ImageF SemiGlobalDisparity(const ImageU8& left, const ImageU8& right, int min_disparity,
                           int disparities, const MatchOptions& options) {
  Require(left.width == right.width && left.height == right.height,
          "a rectified pair must have images of one size");
  Require(disparities >= 16 && disparities % 16 == 0,
          "the number of disparities must be a multiple of 16");
  // Pixels whose whole range does not lie in the right image would be left out: widen both images.
  const int before = std::max(0, min_disparity + disparities), after = std::max(0, -min_disparity);
  cv::Mat wide_left, wide_right;
  cv::copyMakeBorder(View(left), wide_left, 0, 0, before, after, cv::BORDER_CONSTANT);
  cv::copyMakeBorder(View(right), wide_right, 0, 0, before, after, cv::BORDER_CONSTANT);
  return SemiGlobal(wide_left, wide_right, min_disparity, disparities, options, before, left.width);
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
