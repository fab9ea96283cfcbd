#pragma once

#include "core/fit_sequence.h"
#include "core/ground_surface.h"
#include "core/point_cloud.h"

namespace sole::contact {

struct GroundOptions {
  double inlier_distance_m = 0.0003;  ///< RANSAC threshold on platform points
  double prior_sigma_m = 0.00005;     ///< how far the plate is trusted to lie where calibration put it
  double prior_tilt_sigma = 0.0003;   ///< rad; 0.3 mrad is 0.05 mm over half a foot
  int minimum_points = 50;            ///< fewer platform points: the calibrated plane is returned
};

/// Ground plane of one frame in the world frame, from points of the glass platform (`platform`, without the
/// foot): how far they have moved from where the calibration saw uncovered glass (its fiducials) moves the plane of the
/// `calibrated` surface (default: z = 0). RANSAC to set outliers aside (PCL), then weighted least squares with no movement as
/// prior. Points of a platform are few and lie outside the foot, so the prior keeps the tilt sane.
GroundPlane EstimateGround(const PointCloud& platform, const GroundSurface& calibrated = {},
                           const GroundOptions& options = {});

/// Signed height of a point above the ground; the residual of the `calibrated` surface is added to the plane.
double Gap(const GroundPlane& ground, const Eigen::Vector3d& point, const GroundSurface& calibrated = {});

}  // namespace sole::contact
