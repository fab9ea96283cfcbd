#include <algorithm>
#include <cmath>

#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/boards_internal.h"

namespace sole::calib {
namespace {

/// What cornerSubPix leaves on ordinary pictures.
constexpr double kSigmaPx = 0.1;

/// Brightness in the middle of the square between four corners.
int SquareLevel(const ImageU8& image, const std::vector<cv::Point2f>& corners, int first, int columns) {
  cv::Point2f middle(0, 0);
  for (const int corner : {first, first + 1, first + columns, first + columns + 1})
    middle += 0.25f * corners[static_cast<std::size_t>(corner)];
  return image.At(std::clamp(static_cast<int>(std::lround(middle.x)), 0, image.width - 1),
                  std::clamp(static_cast<int>(std::lround(middle.y)), 0, image.height - 1));
}

/// Half a turn swaps black and white where one number of corners is even and one odd: begin with
/// the black square. Other boards look the same: begin with the end nearer to the upper left.
bool BeginsAtTheOtherEnd(const ImageU8& image, const std::vector<cv::Point2f>& corners,
                         const Board& board) {
  if ((board.columns + board.rows) % 2 != 0) {
    return SquareLevel(image, corners, 0, board.columns) >
           SquareLevel(image, corners, 1, board.columns);
  }
  return corners.front().x + corners.front().y > corners.back().x + corners.back().y;
}

}  // namespace

std::vector<PointObservation> DetectChessboard(const ImageU8& image, const Board& board) {
  const cv::Mat view(image.height, image.width, CV_8UC1,
                     const_cast<std::uint8_t*>(image.pixels.data()));
  std::vector<cv::Point2f> corners;
  if (!cv::findChessboardCorners(view, {board.columns, board.rows}, corners,
                                 cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE))
    return {};
  cv::cornerSubPix(view, corners, {5, 5}, {-1, -1},
                   {cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 50, 1e-4});
  if (BeginsAtTheOtherEnd(image, corners, board)) std::reverse(corners.begin(), corners.end());
  std::vector<PointObservation> found;
  for (std::size_t i = 0; i < corners.size(); ++i)
    found.push_back({static_cast<int>(i), {corners[i].x, corners[i].y}, kSigmaPx});
  return found;
}

}  // namespace sole::calib
