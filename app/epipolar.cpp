#include "app/epipolar.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/plate.h"
#include "io/take.h"
#include "recon/match.h"
#include "recon/rectify.h"

namespace sole::app {
namespace {

constexpr int kPatch = 10;    // half the edge of a patch, rectified pixels
constexpr int kReach = 14;    // rows searched above and below
constexpr int kPatches = 240;
constexpr double kAlike = 0.85;
constexpr int kFewest = 20;

double Median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The image as seen by the rectified view.
cv::Mat Warp(const ImageU8& image, const recon::RectifiedView& view) {
  const auto wrap = [](const ImageF& map) {
    return cv::Mat(map.height, map.width, CV_32F, const_cast<float*>(map.pixels.data()));
  };
  const cv::Mat raw(image.height, image.width, CV_8U,
                    const_cast<std::uint8_t*>(image.pixels.data()));
  cv::Mat warped;
  cv::remap(raw, warped, wrap(view.map_x), wrap(view.map_y), cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  return warped;
}

/// Peak of a parabola through three values; 0 is the middle one.
double Peak(double before, double at, double after) {
  const double curvature = before - 2 * at + after;
  return curvature < 0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0;
}

/// Finds the left patch around `x`, `y` in the right image; not finite where it is not certain.
Eigen::Vector2d FindPatch(const cv::Mat& left, const cv::Mat& right, int x, int y, int disparities) {
  const Eigen::Vector2d nowhere = Eigen::Vector2d::Constant(std::nan(""));
  const int edge = 2 * kPatch + 1;
  const cv::Rect patch(x - kPatch, y - kPatch, edge, edge);
  cv::Rect search(x - kPatch - disparities - 2, y - kPatch - kReach, edge + disparities + 4,
                  edge + 2 * kReach);
  search &= cv::Rect(0, 0, right.cols, right.rows);
  if (search.width < edge + 4 || search.height < edge + 4) return nowhere;
  cv::Mat score;
  cv::matchTemplate(right(search), left(patch), score, cv::TM_CCOEFF_NORMED);
  double best = 0;
  cv::Point at;
  cv::minMaxLoc(score, nullptr, &best, nullptr, &at);
  if (!(best > kAlike) || at.x < 1 || at.y < 1 || at.x + 1 >= score.cols || at.y + 1 >= score.rows)
    return nowhere;
  const auto value = [&](int dx, int dy) {
    return static_cast<double>(score.at<float>(at.y + dy, at.x + dx));
  };
  return {search.x + at.x + kPatch + Peak(value(-1, 0), value(0, 0), value(1, 0)),
          search.y + at.y + kPatch + Peak(value(0, -1), value(0, 0), value(0, 1))};
}

/// Signed distance of two rays, and how far from the right camera they pass each other.
struct Passing {
  double gap_m = 0;
  double depth_m = 0;
};
Passing Pass(const Ray& a, const Ray& b, const Camera& right) {
  const Eigen::Vector3d across = a.direction.cross(b.direction).normalized();
  const Eigen::Vector3d point = IntersectRays(a, b).point;
  return {across.dot(b.origin - a.origin), (point - right.CentreInWorld()).norm()};
}

EpipolarOffset OffsetOf(const ImageU8& left_image, const ImageU8& right_image, const Rig& rig,
                        const StereoPair& pair) {
  const Camera& left = rig.cameras[static_cast<std::size_t>(pair.left)];
  const Camera& right = rig.cameras[static_cast<std::size_t>(pair.right)];
  EpipolarOffset result{pair.name, left.serial, right.serial, 0, 0, 0};
  const recon::Rectification rectification = recon::Rectify(rig, pair, {.scale = 1});
  const cv::Mat a = Warp(left_image, rectification.left);
  const cv::Mat b = Warp(right_image, rectification.right);
  std::vector<double> offsets;
  const int step = std::max(
      4, static_cast<int>(std::sqrt(static_cast<double>(a.rows) * a.cols / (4.0 * kPatches))));
  for (int y = kPatch + 1; y + kPatch + 1 < a.rows; y += step) {
    for (int x = kPatch + 1; x + kPatch + 1 < a.cols; x += step) {
      cv::Scalar mean, deviation;
      cv::meanStdDev(a(cv::Rect(x - kPatch, y - kPatch, 2 * kPatch + 1, 2 * kPatch + 1)), mean,
                     deviation);
      if (deviation[0] < 12) continue;
      const Eigen::Vector2d found = FindPatch(a, b, x, y, rectification.disparities);
      if (!found.allFinite()) continue;
      const Eigen::Vector2d raw_left = recon::LookUpRaw(rectification.left, Eigen::Vector2d(x, y));
      const Eigen::Vector2d raw_right = recon::LookUpRaw(rectification.right, found);
      if (!raw_left.allFinite() || !raw_right.allFinite()) continue;
      const Passing passing = Pass(RayFromPixel(left, rig.plate, raw_left),
                                   RayFromPixel(right, rig.plate, raw_right), right);
      if (!std::isfinite(passing.gap_m) || !(passing.depth_m > 0)) continue;
      offsets.push_back(passing.gap_m / passing.depth_m * right.intrinsics[0]);
    }
  }
  if (static_cast<int>(offsets.size()) < kFewest) return result;
  result.matches = static_cast<int>(offsets.size());
  result.offset_px = Median(offsets);
  for (double& offset : offsets) offset = std::abs(offset - result.offset_px);
  // 1.48 MAD is the standard deviation, 1.25 times its standard error that of the median.
  result.sd_px = 1.25 * 1.48 * Median(offsets) / std::sqrt(static_cast<double>(result.matches));
  return result;
}

}  // namespace

std::vector<EpipolarOffset> EpipolarOffsets(const FrameSet& set, const Rig& rig) {
  std::vector<EpipolarOffset> offsets;
  for (const StereoPair& pair : rig.pairs) {
    const auto& left = set.images.at(static_cast<std::size_t>(pair.left));
    const auto& right = set.images.at(static_cast<std::size_t>(pair.right));
    if (left && right) offsets.push_back(OffsetOf(*left, *right, rig, pair));
  }
  return offsets;
}

std::vector<capture::TakeFinding> CheckCalibration(const std::string& directory, const Rig& rig,
                                                   double limit_px) {
  const io::TakeReader take(directory);
  Require(take.Info().rig_hash == rig.rig_hash,
          directory + " was recorded with another rig than the calibration was made for");
  std::vector<capture::TakeFinding> findings;
  for (std::size_t i = 0; i < take.Triggers().size(); ++i) {
    if (take.Triggers()[i].kind != ExposureKind::kSpeckle) continue;
    for (const EpipolarOffset& offset : EpipolarOffsets(take.Read(i), rig)) {
      if (offset.matches == 0 || std::abs(offset.offset_px) - 2 * offset.sd_px <= limit_px) continue;
      findings.push_back(
          {fmt::format("pair {} ({}, {}) has left its calibration: rays miss each other by {:.1f} px "
                       "(limit {:.1f}): a camera was bumped, calibrate again",
                       offset.pair, offset.left, offset.right, std::abs(offset.offset_px), limit_px),
           true});
    }
    break;  // one set tells
  }
  return findings;
}

}  // namespace sole::app
