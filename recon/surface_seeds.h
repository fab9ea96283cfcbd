#pragma once

#include <vector>

#include "core/point_cloud.h"
#include "core/rig.h"
#include "recon/grid_match.h"

namespace sole::recon {

/// What a surface (points with normals) says of the matches of left pixels whose coordinates are
/// multiples of `step_px`: place and slopes in the right image by the exact rays, of the nearest
/// point that faces both cameras. The matches know nothing of correlation or covariance. Throws
/// Error if the surface has no normals.
std::vector<PixelMatch> SeedsFromSurface(const Rig& rig, int pair, const PointCloud& surface,
                                         int step_px);

}  // namespace sole::recon
