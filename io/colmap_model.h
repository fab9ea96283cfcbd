#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/camera.h"

namespace sole::io {

/// A view of a COLMAP model: a camera and the image it took.
struct ColmapView {
  Camera camera;
  std::string image;  ///< file name inside the images folder; no spaces
};

/// A point of a COLMAP model and where views see it.
struct ColmapPoint {
  Eigen::Vector3d point_m;
  int grey = 128;
  struct Observation {
    int view = 0;           ///< index of the view
    Eigen::Vector2d pixel;  ///< our convention
  };
  std::vector<Observation> seen;
};

/// Writes COLMAP's text model into FOLDER: cameras.txt (PINHOLE without distortion, else
/// FULL_OPENCV; principal points in COLMAP's convention, where the first pixel's centre is (0.5,
/// 0.5)), images.txt (cameras and images count from 1) and points3D.txt. COLMAP knows no refraction: cameras below the glass are written as they stand. Throws
/// Error if an image's name is empty or has white space, or a point is seen by a view that is not there.
void WriteColmapModel(const std::filesystem::path& folder, const std::vector<ColmapView>& views,
                      const std::vector<ColmapPoint>& points = {});

/// Views of a text model, by image id. Knows the camera models SIMPLE_PINHOLE, PINHOLE,
/// SIMPLE_RADIAL, RADIAL, OPENCV and FULL_OPENCV without k4 to k6. Serial numbers are the camera
/// ids. Throws Error with path and line.
std::vector<ColmapView> ReadColmapModel(const std::filesystem::path& folder);

}  // namespace sole::io
