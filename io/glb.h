#pragma once

#include <filesystem>
#include <vector>

#include <Eigen/Core>

namespace sole::io {

/// A surface that moves: the same triangles in every frame.
struct MeshAnimation {
  std::vector<Eigen::Vector3i> triangles;  ///< counter-clockwise seen from outside
  std::vector<Eigen::MatrixX3d> frames;    ///< N x 3 vertices each, metres, world frame (z up)
  double rate_hz = 10;                     ///< frames a second, so frame k is shown at k / rate_hz
  std::vector<Eigen::Vector3f> colours;    ///< per vertex, linear red, green, blue 0 to 1; or empty
};

/// One binary glTF 2.0 file (metres, y up: x, z, -y of the world frame) with normals. More than one
/// frame becomes a morph-target animation: a target per further frame, positions and normals
/// relative to the first, weights interpolated linearly between frames. Throws Error with the path
/// on a frame of another size, a value that is not finite or a triangle out of range. Written
/// atomically.
void WriteGlb(const std::filesystem::path& path, const MeshAnimation& animation);

}  // namespace sole::io
