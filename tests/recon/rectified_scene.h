#pragma once

#include <algorithm>
#include <limits>

#include "tests/recon/speckle_scene.h"

namespace sole::testing_support {

/// A rectified pair of pinholes that looks straight down, with the exact disparity of every left
/// pixel. The right camera's principal point is moved so that disparities are small.
struct RectifiedScene {
  Camera left, right;
  Surface surface;
  ImageF left_grey, right_grey;  ///< not rounded, with noise
  ImageF disparity;              ///< NaN where nothing is hit
};

struct RectifiedSceneOptions {
  int width = 420, height = 320;
  double focal_px = 3250, distance_m = 0.6, baseline_m = 0.12;
  double noise = 2;
  double offset_px = 600;  ///< taken off every disparity
  double cell_m = 0.0007;  ///< of the speckle: 3.8 px
};

inline RectifiedScene MakeRectifiedScene(const Surface& surface,
                                         const RectifiedSceneOptions& options = {}) {
  RectifiedScene scene;
  scene.surface = surface;
  Camera camera;
  camera.width = options.width;
  camera.height = options.height;
  camera.intrinsics << options.focal_px, options.focal_px, 0.5 * options.width,
      0.5 * options.height, 0, 0, 0, 0, 0;
  // Camera x is world x, camera z looks along -z.
  const Eigen::Quaterniond turned(0, 1, 0, 0);
  const auto place = [&](double x) {
    camera.cam_from_world.rotation = turned;
    camera.cam_from_world.translation = -(turned * Eigen::Vector3d(x, 0, options.distance_m));
    return camera;
  };
  scene.left = place(0);
  scene.right = place(options.baseline_m);
  scene.right.intrinsics[2] += options.offset_px;
  const Plate plate;
  scene.left_grey =
      RenderSpeckleLevels(scene.left, plate, surface,
                          {.cell_m = options.cell_m, .noise = options.noise, .samples = 3, .seed = 1});
  scene.right_grey =
      RenderSpeckleLevels(scene.right, plate, surface,
                          {.cell_m = options.cell_m, .noise = options.noise, .samples = 3, .seed = 2});
  scene.disparity =
      ImageF(options.width, options.height, std::numeric_limits<float>::quiet_NaN());
  for (int y = 0; y < options.height; ++y) {
    for (int x = 0; x < options.width; ++x) {
      Eigen::Vector3d origin, direction;
      TracePixel(scene.left, plate, x, y, origin, direction);
      const auto t = surface.hit(origin, direction);
      if (!t) continue;
      const double depth = -*t * direction.z();
      scene.disparity.At(x, y) = static_cast<float>(
          options.focal_px * options.baseline_m / depth - options.offset_px);
    }
  }
  return scene;
}

}  // namespace sole::testing_support
