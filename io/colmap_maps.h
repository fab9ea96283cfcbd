#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "core/image.h"
#include "core/point_cloud.h"
#include "io/colmap_model.h"

namespace sole::io {

/// COLMAP's depth map: metres along the camera's z axis, 0 where unknown. Atomic.
void WriteColmapDepthMap(const std::filesystem::path& path, const ImageF& depth_m);
/// Throws Error with the path if the header or the length is wrong.
ImageF ReadColmapDepthMap(const std::filesystem::path& path);

/// COLMAP's normal map: unit normals in the camera frame, zero where unknown, row by row.
void WriteColmapNormalMap(const std::filesystem::path& path, int width, int height,
                          const std::vector<Eigen::Vector3f>& normals);
/// `normals` row by row; throws Error with the path.
std::vector<Eigen::Vector3f> ReadColmapNormalMap(const std::filesystem::path& path, int& width,
                                                 int& height);

/// One view of a dense COLMAP workspace. The camera has no distortion.
struct ColmapDenseView {
  ColmapView view;
  ImageU8 grey;
  ImageF depth_m;
  std::vector<Eigen::Vector3f> normals;  ///< camera frame
};

/// A workspace that `colmap stereo_fusion --workspace_path FOLDER --input_type geometric` reads:
/// images/, sparse/ (text model), stereo/depth_maps/NAME.geometric.bin, stereo/normal_maps/ and
/// stereo/fusion.cfg. Of `points` about a thousand become points of the model, seen where a depth
/// map agrees with them: COLMAP takes from them which views overlap. Principal points are moved by half a
/// pixel, because stereo_fusion reads maps so.
void WriteColmapWorkspace(const std::filesystem::path& folder,
                          const std::vector<ColmapDenseView>& views, const PointCloud& points);

}  // namespace sole::io
