#include "calib/markers_internal.h"

#include <opencv2/aruco.hpp>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

namespace sole::calib {

std::vector<Marker> FindMarkers(const ImageU8& image, bool mirrored, int dictionary_number,
                                int border_cells) {
  const cv::Mat view(image.height, image.width, CV_8UC1,
                     const_cast<std::uint8_t*>(image.pixels.data()));
  cv::Mat flipped;
  if (mirrored) cv::flip(view, flipped, 1);
  const auto dictionary = cv::aruco::getPredefinedDictionary(dictionary_number);
  const auto parameters = cv::aruco::DetectorParameters::create();
  parameters->adaptiveThreshWinSizeMin = 7;
  parameters->adaptiveThreshWinSizeMax = 35;
  parameters->adaptiveThreshWinSizeStep = 14;
  parameters->minMarkerPerimeterRate = 0.02;
  parameters->errorCorrectionRate = 0.3;
  parameters->markerBorderBits = border_cells;
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(mirrored ? flipped : view, dictionary, corners, ids, parameters);
  std::vector<Marker> markers;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    Marker marker{ids[i], {}};
    for (std::size_t k = 0; k < 4; ++k) {
      const double x = corners[i][k].x;
      marker.corners[k] = {mirrored ? image.width - 1 - x : x, corners[i][k].y};
    }
    markers.push_back(marker);
  }
  return markers;
}

std::optional<Homography> FitPlane(const std::vector<Marker>& markers,
                                   const std::vector<Quad>& in_plane, double tolerance_px,
                                   int min_markers, std::vector<bool>& inlier) {
  if (static_cast<int>(markers.size()) < min_markers) return {};
  std::vector<cv::Point2d> plane, image;
  for (std::size_t i = 0; i < markers.size(); ++i) {
    for (std::size_t k = 0; k < 4; ++k) {
      plane.emplace_back(in_plane[i][k].x(), in_plane[i][k].y());
      image.emplace_back(markers[i].corners[k].x(), markers[i].corners[k].y());
    }
  }
  const cv::Mat found = cv::findHomography(plane, image, cv::RANSAC, tolerance_px);
  if (found.empty()) return {};
  Homography homography;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) homography.image_from_plane(r, c) = found.at<double>(r, c);
  }
  inlier.assign(markers.size(), true);
  int count = 0;
  for (std::size_t i = 0; i < markers.size(); ++i) {
    for (std::size_t k = 0; k < 4; ++k) {
      const double miss = (homography * in_plane[i][k] - markers[i].corners[k]).norm();
      if (!(miss < 1.5 * tolerance_px)) inlier[i] = false;
    }
    count += inlier[i];
  }
  if (count < min_markers) return {};
  return homography;
}

}  // namespace sole::calib
