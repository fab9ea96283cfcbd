#pragma once

#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include "core/mesh.h"

namespace sole::io {

/// A scan by another program, in the file's own unit and frame. Points alone have no triangles.
struct ScanFile {
  TriangleMesh mesh;
  std::vector<Eigen::Vector3d> normals;  ///< one per vertex, as the file gives them, or empty
};

/// Reads PLY, Wavefront OBJ or STL (binary or text) by the name's ending, in upper or lower case. Polygons are split
/// into triangles, corners that an STL file repeats become one vertex. Sizes are checked against the file's before
/// anything is allocated; coordinates may be NaN. Throws Error with the path (and the line of a text) where the
/// ending is another, the file is damaged, or it holds no vertex.
ScanFile ReadScanFile(const std::filesystem::path& path);

}  // namespace sole::io
