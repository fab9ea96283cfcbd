#pragma once

#include <Eigen/Core>

#include "core/image.h"
#include "core/rig.h"

namespace sole::recon {

/// Box of the world where a surface is looked for. Cameras below the glass see the sole, so their
/// range of heights ends at `max_height_through_glass_m`.
struct CaptureVolume {
  Eigen::Vector3d min_m{-0.11, -0.19, -0.002};
  Eigen::Vector3d max_m{0.11, 0.19, 0.17};
  double max_height_through_glass_m = 0.10;
};

struct RectifyOptions {
  CaptureVolume volume = {};
  double scale = 0.4;          ///< rectified pixels per raw pixel
  double min_focal_px = 1200;  ///< of the rectified images where the raw ones have it: raises scale
  double mid_height_m = 0.03;  ///< height at which views through the glass are exact
};

/// One camera of a rectified pair: the pinhole that stands for it, and where its pixels come from.
struct RectifiedView {
  Camera camera;
  bool through_plate = false;
  Eigen::Vector3d
      centre_m;  ///< of the pinhole, world frame: nearest to the camera's rays beyond the glass
  Eigen::Vector2d
      origin_px;        ///< image-plane position (focal_px times tangent) of rectified pixel (0, 0)
  ImageF map_x, map_y;  ///< raw pixel of every rectified pixel; -1e4 where there is none
};

/// A pair turned so that corresponding points share a row. Disparity is left x minus right x, 0 to
/// `disparities` over the capture volume. For views through the glass no pinhole is exact: the maps
/// are exact for points at mid_height_m, and the rows of other points of the volume agree to about
/// a pixel.
struct Rectification {
  Eigen::Matrix3d rect_from_world;
  double focal_px = 0;
  int width = 0;
  int height = 0;
  int disparities = 0;  ///< a multiple of 16
  double mid_height_m = 0;
  Plate plate;
  RectifiedView left, right;
};

/// Throws Error if the cameras stand at one place, look along their baseline, or share no part of
/// the volume.
Rectification Rectify(const Rig& rig, const StereoPair& pair, const RectifyOptions& options = {});

/// Rectified pixel of a world point under the pinhole of a view.
Eigen::Vector2d RectifiedFromWorld(const Rectification& rectification, const RectifiedView& view,
                                   const Eigen::Vector3d& point_in_world);
/// Rectified pixel of a raw pixel, and back; inverses of each other.
Eigen::Vector2d RectifiedFromRaw(const Rectification& rectification, const RectifiedView& view,
                                 const Eigen::Vector2d& raw_px);
Eigen::Vector2d RawFromRectified(const Rectification& rectification, const RectifiedView& view,
                                 const Eigen::Vector2d& rectified_px);

/// Bilinear look-up of RawFromRectified in the view's maps; not finite outside.
Eigen::Vector2d LookUpRaw(const RectifiedView& view, const Eigen::Vector2d& rectified_px);

}  // namespace sole::recon
