#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/camera.h"

namespace sole::io {

/// Where an image sees a point; `pixel` in our convention.
struct ColmapPixel {
  Eigen::Vector2d pixel;
  int point = -1;  ///< index of the model's point; -1: of none
};

/// An image of a COLMAP model.
struct ColmapImage {
  std::string name;  ///< file name inside the images folder; no spaces
  int camera = 0;    ///< index of the model's camera
  Rigid3 cam_from_world;
  std::vector<ColmapPixel> pixels;
};

struct ColmapPoint {
  Eigen::Vector3d point_m;
  int grey = 128;
};

/// A COLMAP model. Cameras may have taken several images; their own cam_from_world is not used.
struct ColmapModel {
  std::vector<Camera> cameras;
  std::vector<ColmapImage> images;
  std::vector<ColmapPoint> points;
};

/// A camera, with its pose, and the only image it took.
struct ColmapView {
  Camera camera;
  std::string image;  ///< as ColmapImage::name
};

/// Model of cameras that took one image each, without points, and the other way round: one view per
/// image.
ColmapModel ModelOfViews(const std::vector<ColmapView>& views);
std::vector<ColmapView> ViewsOf(const ColmapModel& model);

/// Writes COLMAP's text model into FOLDER: cameras.txt (PINHOLE without distortion, else
/// FULL_OPENCV; principal points in COLMAP's convention, where the first pixel's centre is (0.5,
/// 0.5)), images.txt (cameras, images and points count from 1 in their order) and points3D.txt. COLMAP
/// knows no refraction: cameras below the glass are written as they stand. Throws Error if an image's
/// name is empty or has white space, or a camera or point is named that is not there.
void WriteColmapModel(const std::filesystem::path& folder, const ColmapModel& model);

/// A text model; cameras, images and points by their ids. Knows the camera models SIMPLE_PINHOLE,
/// PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV and FULL_OPENCV without k4 to k6. Serial numbers are the
/// camera ids. Throws Error with path and line, also where images.txt and points3D.txt contradict
/// each other.
ColmapModel ReadColmapModel(const std::filesystem::path& folder);

}  // namespace sole::io
