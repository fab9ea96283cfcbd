#include "calib/detect.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <opencv2/aruco.hpp>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <string>

#include "calib/edge_fit.h"
#include "calib/markers_internal.h"
#include "core/error.h"

namespace sole::calib {
namespace {

/// Corners of marker `number` of a face in the board plane, in units of squares. Markers sit on the
/// white squares (column + row odd), row by row.
Quad MarkerInBoard(const CharucoFace& face, int number) {
  int square = -1;
  for (int left = number; left >= 0; --left) {
    do ++square;
    while ((square % face.squares_x + square / face.squares_x) % 2 == 0);
  }
  const Eigen::Vector2d centre(square % face.squares_x + 0.5, square / face.squares_x + 0.5);
  const double h = 0.5 * face.marker_m / face.square_m;
  return {centre + Eigen::Vector2d(-h, -h), centre + Eigen::Vector2d(h, -h),
          centre + Eigen::Vector2d(h, h), centre + Eigen::Vector2d(-h, h)};
}

/// Fitted corners of one face whose markers were found. Points are numbered from `first_point`.
void DetectFace(const ImageU8& image, const CharucoFace& face, int first_point,
                const std::vector<Marker>& markers, const DetectOptions& options,
                std::vector<PointObservation>& found) {
  std::vector<Marker> mine;
  std::vector<Quad> in_plane;
  for (const Marker& marker : markers) {
    const int number = marker.id - face.first_id;
    if (number < 0 || number >= MarkerCount(face)) continue;
    mine.push_back(marker);
    in_plane.push_back(MarkerInBoard(face, number));
  }
  std::vector<bool> inlier;
  const auto plane = FitPlane(mine, in_plane, 3.0, options.min_markers, inlier);
  if (!plane || plane->JacobianAt({0.5 * face.squares_x, 0.5 * face.squares_y}).determinant() <= 0)
    return;

  const int columns = face.squares_x - 1, rows = face.squares_y - 1;
  for (int corner = 0; corner < columns * rows; ++corner) {
    const int cx = corner % columns + 1, cy = corner / columns + 1;
    const Eigen::Vector2d in_board(cx, cy);
    const Eigen::Matrix2d jacobian = plane->JacobianAt(in_board);
    SaddleGuess guess;
    guess.pixel = *plane * in_board;
    guess.along_x = jacobian.col(0);
    guess.along_y = jacobian.col(1);
    guess.clear = 0.85 * 0.5 * (1 - face.marker_m / face.square_m);
    guess.white_first = (cx + cy) % 2 == 1;
    // Near the edge of a grazing face the neighbourhood must stay inside the squares.
    const double narrow =
        std::abs(jacobian.determinant()) / std::max(guess.along_x.norm(), guess.along_y.norm());
    const double radius = std::min(options.saddle_radius_px, 0.6 * narrow);
    if (radius < 2.5) continue;
    const auto point = FitSaddle(image, guess, radius);
    if (!point || !(point->sigma_px <= options.max_sigma_px)) continue;
    found.push_back(
        {first_point + corner, point->pixel, std::hypot(point->sigma_px, options.sigma_floor_px)});
  }
}

/// Fiducials whose places agree with the plane of the others.
void DetectFiducials(const ImageU8& image, const std::vector<Fiducial>& fiducials,
                     const std::vector<Marker>& markers, const DetectOptions& options,
                     std::vector<PointObservation>& found) {
  std::vector<Marker> mine;
  std::vector<Quad> in_plane;
  std::vector<std::size_t> index;
  for (const Marker& marker : markers) {
    for (std::size_t i = 0; i < fiducials.size(); ++i) {
      if (fiducials[i].id != marker.id) continue;
      mine.push_back(marker);
      index.push_back(i);
      Quad& quad = in_plane.emplace_back();
      const auto corners = FiducialCorners(fiducials[i]);
      for (std::size_t k = 0; k < 4; ++k) quad[k] = corners[k].head<2>();
    }
  }
  std::vector<bool> inlier(mine.size(), true);
  // Lens distortion bends the plate by some pixels, so the tolerance is wide; a wrong id is off by
  // far more.
  if (mine.size() > 1 && !FitPlane(mine, in_plane, 0.01 * image.width, 2, inlier)) return;
  for (std::size_t i = 0; i < mine.size(); ++i) {
    if (!inlier[i]) continue;
    const Quad& corners = mine[i].corners;
    const double module =
        std::min((corners[1] - corners[0]).norm(), (corners[2] - corners[1]).norm()) / 7;
    const auto fitted = FitSquare(image, corners, std::min(3.0 + 2 * options.blur_px, 0.45 * module));
    if (!fitted) continue;
    for (std::size_t k = 0; k < 4; ++k) {
      const FittedPoint& point = (*fitted)[k];
      if (!(point.sigma_px <= options.max_sigma_px)) continue;
      found.push_back({static_cast<int>(4 * index[i] + k), point.pixel,
                       std::hypot(point.sigma_px, options.fiducial_sigma_floor_px)});
    }
  }
}

/// Markers of the body among those found.
int CountOf(const CalibrationBody& body, const std::vector<Marker>& markers) {
  int ids = 0;
  for (const CharucoFace& face : body.faces) ids += MarkerCount(face);
  return static_cast<int>(std::count_if(markers.begin(), markers.end(), [&](const Marker& marker) {
    return marker.id >= body.faces.front().first_id && marker.id < body.faces.front().first_id + ids;
  }));
}

/// That many in one image are no chance.
constexpr int kMirroredMarkers = 3;

}  // namespace

DetectTarget TargetOf(const RigConfig& config) {
  const TargetConfig& t = config.target;
  return {MakeCalibrationCube(t.edge_m, t.squares, t.square_m, t.marker_m), config.plate.fiducials};
}

DetectOptions SpeckleDetectOptions() {
  DetectOptions options;
  options.blur_px = 2.5;
  options.fiducial_sigma_floor_px = 0.3;
  options.max_sigma_px = 1;
  return options;
}

ViewObservations DetectInImage(const ImageU8& sharp, const DetectTarget& target,
                               bool mirrored_fiducials, const DetectOptions& options) {
  ViewObservations view;
  if (sharp.Empty()) return view;
  ImageU8 smooth;
  if (options.blur_px > 0) {
    smooth = sharp;
    cv::Mat pixels(smooth.height, smooth.width, CV_8UC1, smooth.pixels.data());
    cv::GaussianBlur(pixels, pixels, {}, options.blur_px);
  }
  const ImageU8& image = options.blur_px > 0 ? smooth : sharp;
  const std::vector<Marker> markers = FindMarkers(image, false, cv::aruco::DICT_5X5_250);
  int first_point = 0;
  for (const CharucoFace& face : target.body.faces) {
    DetectFace(image, face, first_point, markers, options, view.target);
    first_point += (face.squares_x - 1) * (face.squares_y - 1);
  }
  std::vector<Marker> flipped;
  if (mirrored_fiducials || view.target.empty()) flipped = FindMarkers(image, true, cv::aruco::DICT_5X5_250);
  view.mirrored_target = view.target.empty() && CountOf(target.body, flipped) >= kMirroredMarkers;
  DetectFiducials(image, target.fiducials, mirrored_fiducials ? flipped : markers, options,
                  view.fiducials);
  return view;
}

std::vector<ViewObservations> DetectInFrame(const FrameSet& frame, const RigConfig& config,
                                            const DetectTarget& target,
                                            const DetectOptions& options) {
  const std::size_t cameras = config.cameras.size();
  Require(frame.images.size() == cameras,
          "calibration: frame " + std::to_string(frame.trigger) + " has images of " +
              std::to_string(frame.images.size()) + " cameras, the rig file has " +
              std::to_string(cameras));
  for (std::size_t c = 0; c < cameras; ++c) {
    const CameraConfig& camera = config.cameras[c];
    if (!frame.images[c]) continue;
    Require(frame.images[c]->width == camera.width && frame.images[c]->height == camera.height,
            "calibration: camera " + camera.serial + ", frame " + std::to_string(frame.trigger) +
                ": image is " + std::to_string(frame.images[c]->width) + "x" +
                std::to_string(frame.images[c]->height) + ", the rig file says " +
                std::to_string(camera.width) + "x" + std::to_string(camera.height) +
                "; calibrate with the rig file of the take");
  }
  std::vector<ViewObservations> views(cameras);
  tbb::parallel_for(std::size_t{0}, cameras, [&](std::size_t c) {
    const bool below = config.cameras[c].position_m.z() < 0;
    if (frame.images[c]) views[c] = DetectInImage(*frame.images[c], target, below, options);
  });
  return views;
}

}  // namespace sole::calib
