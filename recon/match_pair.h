#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/image.h"
#include "core/rig.h"
#include "recon/match.h"
#include "recon/subset.h"

namespace sole::recon {

/// Matching of two images from anywhere; grey levels are scaled to 0 to 255 (of any depth).
struct MatchPairOptions {
  int window_px = 15;     ///< odd, 5 to 31
  int step_px = 2;        ///< between refined points
  int min_disparity = 0;  ///< rectified pairs only, any sign
  int disparities = 0;    ///< rectified pairs only; 0: a quarter of the width
  double max_row_px = 2;  ///< rectified pairs only: largest distance from the common row
  MatchOptions semi_global = {};
  SubsetOptions subset = {};  ///< its radius follows window_px
};

struct DisparityMap {
  ImageF disparity;  ///< left x minus right x, pixels of the left image; NaN where there is none
  double coverage = 0;       ///< share of pixels with a disparity
  double median_row_px = 0;  ///< right y minus left y; far from 0 where the pair is not rectified
  double row_spread_px = 0;  ///< 1.48 times the median distance from it
  double mean_zncc = 0;
  double median_sigma_px = 0;  ///< of the disparities, from the matches' covariances
};

/// Sub-pixel disparity of a rectified pair: semi-global matching to begin with, subset refinement in
/// two dimensions on a grid of points, the quadratic warps of a grid cell's corners between them.
/// Pixels whose corners do not all agree have no disparity. Throws Error if the images differ in
/// size or an option is out of range.
DisparityMap MatchRectified(const ImageF& left, const ImageF& right,
                            const MatchPairOptions& options = {});

/// What became of one wanted point of a raw left image.
struct PointMatch {
  Eigen::Vector2d left_px;
  std::string problem;  ///< why there is no match; empty if there is
  Eigen::Vector2d right_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();  ///< of right_px
  double zncc = 0;
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();  ///< world frame, from the exact rays
  double gap_px = 0;  ///< between the two rays, pixels of the left camera at the point
};

/// Matches `points` (left raw pixels, also between pixels) of pair `pair` of a calibrated rig, each
/// from the matched grid point nearest to it. Throws Error if an image's size is not the camera's.
std::vector<PointMatch> MatchPoints(const ImageF& left, const ImageF& right, const Rig& rig,
                                    int pair, std::span<const Eigen::Vector2d> points,
                                    const MatchPairOptions& options = {});

}  // namespace sole::recon
