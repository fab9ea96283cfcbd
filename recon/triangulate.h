#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/rig.h"
#include "recon/grid_match.h"

namespace sole::recon {

struct TriangulateOptions {
  CaptureVolume volume = {};
  double max_gap_px = 1.5;         ///< between the rays, in pixels at the point's distance
  double max_gap_spread = 5;       ///< from the pair's median gap, in robust standard deviations
  double min_gap_window_px = 0.2;  ///< the spread never rejects within this
  double min_angle_rad = 0.03;     ///< between the rays
  double max_sigma_m = 0.0006;     ///< along the ray
  double max_sigma_ratio = 3.5;     ///< of the pair's median: windows across an edge of depth
  double floor_px = 0.010;         ///< error of a match that its covariance does not know
  double max_depth_below_glass_m = 0.001;  ///< deeper points are mirror images
};

/// A triangulated match.
struct PairPoint {
  Eigen::Vector3d point_m;
  Eigen::Vector3d to_camera;  ///< unit, towards the left camera along the ray
  double ray_sigma_m = 0;     ///< standard deviation along the ray
  float intensity = 0;        ///< left grey level
  std::uint8_t pair = 0;
};

struct Triangulation {
  std::vector<PairPoint> points;
  double median_gap_px = 0;  ///< signed; far from 0 where the calibration has drifted
  int bad_gap = 0;
  int outside = 0;  ///< of the volume, or mirrored by the glass
  int uncertain = 0;
};

/// Points from matches of one pair with the exact refracted rays of both raw pixels. `intensity` is
/// read from `left`.
Triangulation Triangulate(const Rig& rig, int pair, std::span<const PixelMatch> matches,
                          const ImageU8& left, const TriangulateOptions& options = {});

}  // namespace sole::recon
