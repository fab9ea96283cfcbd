#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include <Eigen/Core>

#include "core/mesh.h"

namespace sole::app {

using Colour = std::array<std::uint8_t, 3>;  ///< red, green, blue

/// Where a picture is taken from: orthographic, along `direction` (world), `up` upwards in the picture.
struct View {
  Eigen::Vector3d direction;
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

/// A software-rendered picture of meshes and points for reports; hidden surfaces are removed, light comes
/// from beside the viewer.
class Picture {
 public:
  /// Frames the box [low, high] (world, metres) in width x height pixels.
  Picture(int width, int height, const View& view, const Eigen::Vector3d& low, const Eigen::Vector3d& high);

  /// `colours` has one entry per vertex, or one entry for all.
  void DrawMesh(const TriangleMesh& mesh, const std::vector<Colour>& colours);
  /// Points as squares of `size_px`; `colours` as above.
  void DrawPoints(const std::vector<Eigen::Vector3f>& points, const std::vector<Colour>& colours, int size_px = 3);
  void WritePng(const std::filesystem::path& path) const;
  /// The finished pixels row by row, three bytes (red, green, blue) each.
  std::vector<std::uint8_t> Pixels() const;

 private:
  Eigen::Vector3d ToScreen(const Eigen::Vector3d& point) const;  ///< x, y in supersampled pixels, z depth
  void Put(int x, int y, double depth, const Colour& colour);

  int width_, height_;  ///< supersampled
  Eigen::Matrix3d screen_from_world_;
  Eigen::Vector2d offset_;
  double scale_;
  std::vector<float> depth_;
  std::vector<Colour> pixels_;
};

/// Blue (0) over green to red (1); grey for NaN.
Colour HeatColour(double value);

}  // namespace sole::app
