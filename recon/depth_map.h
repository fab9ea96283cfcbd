#pragma once

#include <Eigen/Core>
#include <vector>

#include "core/camera.h"
#include "core/image.h"
#include "core/point_cloud.h"

namespace sole::recon {

/// What a pinhole camera in air at a given place would see of a cloud.
struct DepthMap {
  Camera camera;    ///< without distortion
  ImageF depth_m;   ///< along the camera's z, 0 where there is nothing
  ImageU8 grey;     ///< 0 where there is nothing
  std::vector<Eigen::Vector3f> normals;  ///< camera frame, row by row; zero where there is nothing
};

struct DepthMapOptions {
  double focal_px = 0;           ///< 0: so that a pixel is about as large as the points' spacing
  double spacing_m = 0.00075;    ///< of the points
  double layer_m = 0.002;        ///< points further behind the front one of a pixel are hidden
  double min_cosine = 0.17;      ///< between normal and view: steeper points are left out
};

/// Renders `cloud` (with normals) as `camera` would see it without lens distortion and without glass:
/// the cloud is in the world, so views through the plate are not bent. Depth of a pixel: the points
/// around it carried along the surface by their normals, weighted by distance and variance. Throws Error if
/// the cloud has no normals.
DepthMap RenderDepthMap(const PointCloud& cloud, const Camera& camera,
                        const DepthMapOptions& options = {});

}  // namespace sole::recon
