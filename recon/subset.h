#pragma once

#include <Eigen/Core>

#include "core/image.h"
#include "recon/prepared_image.h"

namespace sole::recon {

/// Map of a neighbourhood: left offset d from the subset's centre lies at
/// position_px + gradient * d + curvature * (d_x d_x / 2, d_x d_y, d_y d_y / 2) in the right image.
struct SubsetWarp {
  Eigen::Vector2d position_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d gradient = Eigen::Matrix2d::Identity();
  Eigen::Matrix<double, 2, 3> curvature = Eigen::Matrix<double, 2, 3>::Zero();

  Eigen::Vector2d operator()(const Eigen::Vector2d& d) const {
    return position_px + gradient * d +
           curvature * Eigen::Vector3d(0.5 * d.x() * d.x(), d.x() * d.y(), 0.5 * d.y() * d.y());
  }
};

struct SubsetOptions {
  int radius_px = 6;  ///< window of 2 radius + 1 pixels, at most 15
  int max_iterations = 8;
  double convergence_px = 0.05;  ///< stop when no corner moves more: the next step is a tenth of it
  double max_travel_px = 4;       ///< from the start to the match
  int patience = 3;               ///< iterations after which a match must be near min_zncc
  double min_zncc = 0.85;
  double min_contrast = 3;     ///< standard deviation of the grey levels in the window
  double max_sigma_px = 0.12;  ///< largest standard deviation of the match in any direction
  double min_window = 0.55;    ///< share of the window that must lie inside the mask
};

enum class SubsetStatus { kMatched, kOutside, kFlat, kDiverged, kPoor, kUncertain };

struct SubsetMatch {
  SubsetStatus status = SubsetStatus::kOutside;
  SubsetWarp warp;
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();  ///< of warp.position_px
  double zncc = 0;
  int iterations = 0;
};

/// Finds the window around `centre` of the left image in the right image: inverse compositional
/// Gauss-Newton on the zero-mean normalised sum of squared differences (Baker and Matthews 2004;
/// Pan, Li and Tong 2013) over an affine warp, grey levels by cubic B-spline. The start's curvature
/// is kept as it is. The covariance is that of least squares with the residual's own variance. Only
/// left pixels with a non-zero `mask` take part (same size as the image; null: all).
SubsetMatch MatchSubset(const PreparedImage& left, const PreparedImage& right, const ImageU8* mask,
                        const Eigen::Vector2i& centre, const SubsetWarp& start,
                        const SubsetOptions& options = {});

}  // namespace sole::recon
