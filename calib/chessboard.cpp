#include "calib/chessboard.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/adjust.h"
#include "calib/judge.h"
#include "calib/start_values.h"
#include "core/error.h"

namespace sole::calib {
namespace {

constexpr double kUnseen = std::numeric_limits<double>::quiet_NaN();
/// What cornerSubPix leaves on ordinary pictures.
constexpr double kSigmaPx = 0.1;

std::vector<Eigen::Vector3d> CornersOf(const Chessboard& board) {
  std::vector<Eigen::Vector3d> corners;
  for (int y = 0; y < board.rows; ++y) {
    for (int x = 0; x < board.columns; ++x) corners.emplace_back(x * board.square_m, y * board.square_m, 0);
  }
  return corners;
}

/// Intrinsics of one camera alone.
Intrinsics StartIntrinsics(const ImageCamera& camera, std::size_t c,
                           const TakeObservations& observations,
                           const std::vector<Eigen::Vector3d>& corners, int min_views) {
  std::vector<std::vector<cv::Point3f>> object;
  std::vector<std::vector<cv::Point2f>> image;
  for (const auto& frame : observations.frames) {
    if (frame[c].target.empty()) continue;
    auto& points = object.emplace_back();
    auto& pixels = image.emplace_back();
    for (const PointObservation& o : frame[c].target) {
      const Eigen::Vector3d& p = corners[static_cast<std::size_t>(o.point)];
      points.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()), 0.0f);
      pixels.emplace_back(static_cast<float>(o.pixel.x()), static_cast<float>(o.pixel.y()));
    }
  }
  Require(static_cast<int>(object.size()) >= min_views,
          "calibration: camera " + camera.name + " sees the whole chessboard in " +
              std::to_string(object.size()) + " of " + std::to_string(observations.frames.size()) +
              " pictures, needs " + std::to_string(min_views) +
              "; check the number of inner corners in --target, light and focus");
  cv::Mat matrix, distortion;
  std::vector<cv::Mat> rvecs, tvecs;
  cv::calibrateCamera(object, image, {camera.width, camera.height}, matrix, distortion, rvecs, tvecs);
  Intrinsics intrinsics;
  intrinsics << matrix.at<double>(0, 0), matrix.at<double>(1, 1), matrix.at<double>(0, 2),
      matrix.at<double>(1, 2), distortion.at<double>(0), distortion.at<double>(1),
      distortion.at<double>(2), distortion.at<double>(3), distortion.at<double>(4);
  return intrinsics;
}

/// Squared reprojection errors of one view, their number.
struct ErrorSum {
  double squares = 0;
  int points = 0;
  void Add(const ErrorSum& other) {
    squares += other.squares;
    points += other.points;
  }
  double Rms() const { return points > 0 ? std::sqrt(squares / points) : kUnseen; }
};

ErrorSum ViewErrors(const AdjustState& state, std::size_t frame, std::size_t camera,
                    const ViewObservations& view, const std::vector<Eigen::Vector3d>& corners) {
  const Projector project(state.cameras[camera], state.plate);
  ErrorSum sum;
  for (const PointObservation& o : view.target) {
    const Eigen::Vector3d world =
        state.world_from_body[frame] * corners[static_cast<std::size_t>(o.point)];
    sum.squares += (project(world) - o.pixel).squaredNorm();
    ++sum.points;
  }
  return sum;
}

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
                         const Chessboard& board) {
  if ((board.columns + board.rows) % 2 != 0) {
    return SquareLevel(image, corners, 0, board.columns) >
           SquareLevel(image, corners, 1, board.columns);
  }
  return corners.front().x + corners.front().y > corners.back().x + corners.back().y;
}

StereoErrors JudgeStereo(const Rig& rig, const StereoPair& pair, const TakeObservations& take,
                         const std::vector<std::vector<ErrorSum>>& errors, const Chessboard& board) {
  const auto left = static_cast<std::size_t>(pair.left), right = static_cast<std::size_t>(pair.right);
  StereoErrors result;
  ErrorSum reprojection, epipolar, lengths;
  for (std::size_t f = 0; f < take.frames.size(); ++f) {
    std::map<int, Eigen::Vector2d> other;
    for (const PointObservation& o : take.frames[f][right].target) other[o.point] = o.pixel;
    if (other.empty() || take.frames[f][left].target.empty()) continue;
    ++result.views;
    reprojection.Add(errors[f][left]);
    reprojection.Add(errors[f][right]);
    std::map<int, Eigen::Vector3d> points;
    for (const PointObservation& o : take.frames[f][left].target) {
      const auto match = other.find(o.point);
      if (match == other.end()) continue;
      const Camera &a = rig.cameras[left], &b = rig.cameras[right];
      const RayIntersection hit = IntersectRays(RayFromPixel(a, rig.plate, o.pixel),
                                                RayFromPixel(b, rig.plate, match->second));
      const double miss = (PixelFromWorld(a, rig.plate, hit.point) - o.pixel).norm() +
                          (PixelFromWorld(b, rig.plate, hit.point) - match->second).norm();
      if (!std::isfinite(miss)) continue;
      epipolar.Add({miss * miss, 1});
      points[o.point] = hit.point;
    }
    for (const auto& [corner, point] : points) {
      for (const int step : {1, board.columns}) {
        if (step == 1 && corner % board.columns == board.columns - 1) continue;
        const auto next = points.find(corner + step);
        if (next == points.end()) continue;
        const double error = (next->second - point).norm() - board.square_m;
        lengths.Add({error * error, 1});
      }
    }
  }
  result.rms_px = reprojection.Rms();
  result.epipolar_px = epipolar.Rms();
  result.square_rms_mm = 1000 * lengths.Rms();
  return result;
}

}  // namespace

Chessboard ParseChessboard(const std::string& text) {
  Chessboard board;
  int length = 0;
  const int read = std::sscanf(text.c_str(), "%dx%d:%lf%n", &board.columns, &board.rows,
                               &board.square_m, &length);
  const std::string unit = read == 3 ? text.substr(static_cast<std::size_t>(length)) : "";
  Require(read == 3 && (unit.empty() || unit == "m" || unit == "mm") && board.columns >= 3 && board.rows >= 3 &&
              board.columns <= 100 && board.rows <= 100 && board.columns * board.rows <= 2500,
          "chessboard '" + text +
              "': give inner corners and square, such as 9x6:25mm (for 10 by 7 squares)");
  if (unit == "mm") board.square_m *= 0.001;
  Require(std::isfinite(board.square_m) && board.square_m > 1e-4 && board.square_m < 1,
          "chessboard '" + text + "': a square must have 0.1 to 1000 mm; a number without unit is metres");
  return board;
}

std::vector<PointObservation> DetectChessboard(const ImageU8& image, const Chessboard& board) {
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

ChessboardResult CalibrateChessboards(const std::vector<ImageCamera>& cameras,
                                      const TakeObservations& observations,
                                      const Chessboard& board, int min_views) {
  const std::vector<Eigen::Vector3d> corners = CornersOf(board);
  AdjustState start;
  start.plate = {1e-6, 1.0};
  start.world_from_body.resize(observations.frames.size());
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    start.cameras.push_back({cameras[c].name, cameras[c].width, cameras[c].height,
                             StartIntrinsics(cameras[c], c, observations, corners, min_views), {}});
  }
  std::vector<bool> placed(cameras.size(), false);
  placed[0] = true;
  placed = PlaceAll(start, observations, corners, placed);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    Require(placed[c], "calibration: camera " + cameras[c].name +
                           " shares no picture of the chessboard with the others; pictures that "
                           "belong together must have the same number");
  }
  AdjustOptions options;
  options.estimate_k3 = true;
  options.estimate_thickness = false;
  options.keep_pose.assign(cameras.size(), false);
  options.keep_pose[0] = true;
  const AdjustResult adjusted = Adjust(start, observations, corners, {}, options);

  ChessboardResult result;
  result.dropped = adjusted.outliers;
  Calibration& calibration = result.calibration;
  calibration.rig.cameras = adjusted.state.cameras;
  calibration.rig.plate = adjusted.state.plate;
  calibration.covariance = adjusted.covariance;
  calibration.stats.reprojection_rms_px = adjusted.reprojection_rms_px;
  calibration.stats.camera_rms_px = adjusted.camera_rms_px;
  calibration.stats.camera_corners = adjusted.camera_corners;
  calibration.stats.poses_used = static_cast<int>(observations.frames.size());
  calibration.stats.heldout_rms_air_mm = calibration.stats.heldout_rms_glass_mm = kUnseen;
  calibration.stats.heldout_rms_across_mm = calibration.stats.heldout_max_mm = kUnseen;
  calibration.stats.ground_rms_mm = kUnseen;
  std::vector<std::vector<ErrorSum>> errors;
  std::vector<ErrorSum> totals(cameras.size());
  for (std::size_t f = 0; f < observations.frames.size(); ++f) {
    auto& row = errors.emplace_back();
    auto& view_rms = result.view_rms_px.emplace_back();
    for (std::size_t c = 0; c < cameras.size(); ++c) {
      row.push_back(ViewErrors(adjusted.state, f, c, observations.frames[f][c], corners));
      view_rms.push_back(row.back().Rms());
      totals[c].Add(row.back());
    }
  }
  for (const ErrorSum& total : totals) result.camera_rms_px.push_back(total.Rms());
  for (int c = 0; c + 1 < static_cast<int>(cameras.size()); ++c) {
    const auto i = static_cast<std::size_t>(c);
    const StereoPair pair{cameras[i].name + "-" + cameras[i + 1].name, c, c + 1};
    const StereoErrors stereo =
        JudgeStereo(calibration.rig, pair, observations, errors, board);
    if (stereo.views == 0) continue;
    calibration.rig.pairs.push_back(pair);
    calibration.stats.pair_offset_mm.push_back(kUnseen);
    calibration.stats.pair_epipolar_px.push_back(stereo.epipolar_px);
    result.pairs.push_back(stereo);
  }
  return result;
}

}  // namespace sole::calib
