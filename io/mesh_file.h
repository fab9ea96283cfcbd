#pragma once

#include <filesystem>
#include <string>

#include "core/mesh.h"
#include "core/point_cloud.h"

namespace sole::io {

/// Binary little-endian PLY. Clouds: x y z, nx ny nz, sigma, intensity (float), pair (uchar), as
/// far as the cloud has them. Units (metres) and frame stand in a comment. Reading accepts ASCII
/// and binary files of other programs, ignores unknown properties and elements, checks counts
/// against the file's size before allocating, and throws Error with the path.
void WritePly(const std::filesystem::path& path, const PointCloud& cloud);
/// `about` says unit and frame.
void WritePly(const std::filesystem::path& path, const TriangleMesh& mesh,
              const std::string& about = "metres, world frame (z up)");
PointCloud ReadPlyCloud(const std::filesystem::path& path);
TriangleMesh ReadPlyMesh(const std::filesystem::path& path);

/// Wavefront OBJ (metres, comment says so) and binary STL (millimetres, as printers expect; the
/// header says so).
void WriteObj(const std::filesystem::path& path, const TriangleMesh& mesh);
void WriteStl(const std::filesystem::path& path, const TriangleMesh& mesh);

}  // namespace sole::io
