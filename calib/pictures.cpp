#include "calib/pictures.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <utility>

#include <Eigen/Eigenvalues>
#include <opencv2/calib3d.hpp>

#include "calib/adjust.h"
#include "calib/judge.h"
#include "calib/start_values.h"
#include "core/error.h"

namespace sole::calib {
namespace {

constexpr double kUnseen = std::numeric_limits<double>::quiet_NaN();
/// Views with fewer corners, or all but in one line, are left out: they hold a pose badly.
constexpr std::size_t kMinCorners = 8;
constexpr double kMinSpread = 0.1;  ///< of the corners, across over along
constexpr int kMirroredViews = 3;
constexpr double kMaxOutlierShare = 0.2;
constexpr double kMaxRms = 0.005;  ///< of the image's width

bool HoldsAPose(const ViewObservations& view, const std::vector<Eigen::Vector3d>& corners) {
  if (view.target.size() < kMinCorners) return false;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  const auto place = [&](const PointObservation& o) -> Eigen::Vector2d {
    return corners[static_cast<std::size_t>(o.point)].head<2>();
  };
  for (const PointObservation& o : view.target)
    mean += place(o) / static_cast<double>(view.target.size());
  for (const PointObservation& o : view.target)
    scatter += (place(o) - mean) * (place(o) - mean).transpose();
  const Eigen::Vector2d spread =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(scatter).eigenvalues();
  return spread[0] > kMinSpread * kMinSpread * spread[1];
}

TakeObservations UsableViews(const TakeObservations& observations,
                             const std::vector<Eigen::Vector3d>& corners) {
  TakeObservations usable = observations;
  for (auto& frame : usable.frames) {
    for (ViewObservations& view : frame) {
      if (!HoldsAPose(view, corners)) view.target.clear();
    }
  }
  return usable;
}

void RequireEnoughViews(const std::vector<ImageCamera>& cameras, const TakeObservations& take,
                        const Board& board, int min_views) {
  const std::string pictures = std::to_string(take.frames.size()) + " pictures";
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    int seen = 0, mirrored = 0;
    for (const auto& frame : take.frames) {
      seen += !frame[c].target.empty();
      mirrored += frame[c].mirrored_target;
    }
    Require(seen >= min_views || mirrored < kMirroredViews,
            "calibration: camera " + cameras[c].name + " shows the board mirrored in " +
                std::to_string(mirrored) + " of " + pictures +
                "; turn off the camera's flipping, or print the board unmirrored");
    const bool whole = board.kind == BoardKind::kChessboard;
    Require(seen >= min_views,
            "calibration: camera " + cameras[c].name + " sees " +
                (whole ? "the whole chessboard" : "enough of the board") + " in " + std::to_string(seen) + " of " + pictures + ", needs " +
                std::to_string(min_views) + "; check the numbers in --target, light and focus");
  }
}

/// Gross contradictions make the adjustment's own measure of an outlier gross, too: then it is the
/// residuals that tell.
void RequireAgreement(const AdjustResult& adjusted, const std::vector<ImageCamera>& cameras) {
  int kept = 0, width = 0;
  for (const int count : adjusted.camera_corners) kept += count;
  for (const ImageCamera& camera : cameras) width = std::max(width, camera.width);
  const double share =
      static_cast<double>(adjusted.outliers) / std::max(1, kept + adjusted.outliers);
  const bool agree = share <= kMaxOutlierShare &&
                     adjusted.reprojection_rms_px <= std::max(3.0, kMaxRms * width);
  char figures[80];
  std::snprintf(figures, sizeof figures, "%.0f %% left out, RMS of the others %.1f px",
                100 * share, adjusted.reprojection_rms_px);
  Require(agree, std::string("calibration: the board's corners contradict each other (") + figures +
                     "); are pictures of one number taken at one moment, the cameras still, no "
                     "camera's pictures mirrored, and the numbers in --target right?");
}

/// Intrinsics of one camera alone.
Intrinsics StartIntrinsics(const ImageCamera& camera, std::size_t c,
                           const TakeObservations& observations,
                           const std::vector<Eigen::Vector3d>& corners) {
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
  cv::Mat matrix, distortion;
  std::vector<cv::Mat> rvecs, tvecs;
  cv::calibrateCamera(object, image, {camera.width, camera.height}, matrix, distortion, rvecs,
                      tvecs);
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

StereoErrors JudgeStereo(const Rig& rig, const StereoPair& pair, const TakeObservations& take,
                         const std::vector<std::vector<ErrorSum>>& errors, const Board& board,
                         const std::vector<Eigen::Vector3d>& corners) {
  const auto left = static_cast<std::size_t>(pair.left),
             right = static_cast<std::size_t>(pair.right);
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
    const int row = CornersInRow(board);
    for (const auto& [corner, point] : points) {
      for (const int step : {1, row}) {
        if (step == 1 && corner % row == row - 1) continue;
        const auto next = points.find(corner + step);
        if (next == points.end()) continue;
        const Eigen::Vector3d known = corners[static_cast<std::size_t>(corner + step)] -
                                      corners[static_cast<std::size_t>(corner)];
        const double error = (next->second - point).norm() - known.norm();
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

BoardScale JudgeBoard(const Rig& rig, const TakeObservations& take, const Board& board) {
  const std::vector<Eigen::Vector3d> corners = BoardCorners(board);
  BoardScale result;
  double measured = 0, known = 0;
  ErrorSum errors;
  for (const auto& frame : take.frames) {
    std::map<int, std::vector<Ray>> rays;
    for (std::size_t c = 0; c < frame.size(); ++c) {
      for (const PointObservation& o : frame[c].target)
        rays[o.point].push_back(RayFromPixel(rig.cameras[c], rig.plate, o.pixel));
    }
    std::vector<std::pair<Eigen::Vector3d, Eigen::Vector3d>> points;  // measured, known
    for (const auto& [corner, views] : rays) {
      const Eigen::Vector3d point = NearestPoint(views);
      if (point.allFinite()) points.emplace_back(point, corners[static_cast<std::size_t>(corner)]);
    }
    for (std::size_t i = 0; i < points.size(); ++i) {
      for (std::size_t k = i + 1; k < points.size(); ++k) {
        const double length = (points[i].first - points[k].first).norm(),
                     given = (points[i].second - points[k].second).norm();
        errors.Add({(length - given) * (length - given), 1});
        measured += length;
        known += given;
      }
    }
  }
  if (errors.points == 0) return result;
  result.lengths = errors.points;
  result.rms_mm = 1000 * errors.Rms();
  result.scale = measured / known;
  return result;
}

BoardResult CalibrateBoards(const std::vector<ImageCamera>& cameras,
                            const TakeObservations& all_observations, const Board& board,
                            int min_views) {
  const std::vector<Eigen::Vector3d> corners = BoardCorners(board);
  const TakeObservations observations = UsableViews(all_observations, corners);
  RequireEnoughViews(cameras, observations, board, min_views);
  AdjustState start;
  start.plate = {1e-6, 1.0};
  start.world_from_body.resize(observations.frames.size());
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    start.cameras.push_back({cameras[c].name, cameras[c].width, cameras[c].height,
                             StartIntrinsics(cameras[c], c, observations, corners), {}});
  }
  std::vector<bool> placed(cameras.size(), false);
  placed[0] = true;
  placed = PlaceAll(start, observations, corners, placed);
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    Require(placed[c], "calibration: camera " + cameras[c].name +
                           " shares no picture of the board with the others; pictures that "
                           "belong together must have the same number");
  }
  AdjustOptions options;
  options.estimate_k3 = true;
  options.estimate_thickness = false;
  options.keep_pose.assign(cameras.size(), false);
  options.keep_pose[0] = true;
  const AdjustResult adjusted = Adjust(start, observations, corners, {}, options);
  RequireAgreement(adjusted, cameras);

  BoardResult result;
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
        JudgeStereo(calibration.rig, pair, observations, errors, board, corners);
    if (stereo.views == 0) continue;
    calibration.rig.pairs.push_back(pair);
    calibration.stats.pair_offset_mm.push_back(kUnseen);
    calibration.stats.pair_epipolar_px.push_back(stereo.epipolar_px);
    result.pairs.push_back(stereo);
  }
  return result;
}

}  // namespace sole::calib
