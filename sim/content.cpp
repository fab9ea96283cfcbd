#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include <tbb/parallel_for.h>

#include "sim/renderer_internal.h"
#include "sim/target_texture.h"

namespace sole::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Projected = std::optional<Vector2d>;

constexpr double kMargin_px = 3;

class Marker {
 public:
  Marker(const TrueCamera& camera, const TruePlate& plate)
      : camera_(camera),
        plate_(plate),
        centre_(camera.Centre()),
        blocks_((camera.width + kBlock - 1) / kBlock, (camera.height + kBlock - 1) / kBlock,
                kNothing) {}

  Projected Project(const Vector3d& point) const {
    return PixelOfDirection(camera_, PathBetween(plate_, centre_, point).leaving);
  }
  /// Where the point's mirror image in the glass top is seen; nowhere by cameras below.
  Projected ProjectMirrored(const Vector3d& point) const {
    if (centre_.z() < 0) return {};
    return PixelOfDirection(camera_, Vector3d(point.x(), point.y(), -point.z()) - centre_);
  }
  /// Marks the blocks that a hull of image points covers, by its bounding box.
  void Mark(std::initializer_list<const Projected*> points, std::uint8_t content) {
    Vector2d low = Vector2d::Constant(1e9), high = -low;
    for (const Projected* point : points) {
      if (!*point) continue;
      low = low.cwiseMin(**point);
      high = high.cwiseMax(**point);
    }
    if (low.x() > high.x()) return;
    const auto block = [](double value, int count) {
      return static_cast<int>(
          std::clamp(std::floor(value / kBlock), -1.0, static_cast<double>(count)));
    };
    const int x0 = std::max(block(low.x() - kMargin_px, blocks_.width), 0);
    const int x1 = std::min(block(high.x() + kMargin_px, blocks_.width), blocks_.width - 1);
    const int y0 = std::max(block(low.y() - kMargin_px, blocks_.height), 0);
    const int y1 = std::min(block(high.y() + kMargin_px, blocks_.height), blocks_.height - 1);
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) blocks_.At(x, y) |= content;
    }
  }
  Image<std::uint8_t> Take() { return std::move(blocks_); }

 private:
  const TrueCamera& camera_;
  const TruePlate& plate_;
  Vector3d centre_;
  Image<std::uint8_t> blocks_;
};

void MarkMesh(const LitMesh& mesh, bool mirror, Marker& marker) {
  std::vector<Projected> direct(mesh.vertices.size()), mirrored(mesh.vertices.size());
  tbb::parallel_for(std::size_t{0}, mesh.vertices.size(), [&](std::size_t i) {
    direct[i] = marker.Project(mesh.vertices[i]);
    if (mirror) mirrored[i] = marker.ProjectMirrored(mesh.vertices[i]);
  });
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const auto a = static_cast<std::size_t>(t[0]), b = static_cast<std::size_t>(t[1]),
               c = static_cast<std::size_t>(t[2]);
    marker.Mark({&direct[a], &direct[b], &direct[c]}, kBodies);
    if (mirror) marker.Mark({&mirrored[a], &mirrored[b], &mirrored[c]}, kBodies);
  }
}

void MarkCube(const Rigid3& world_from_target, double edge_m, bool mirror, Marker& marker) {
  Projected direct[8], mirrored[8];
  for (int i = 0; i < 8; ++i) {
    const Vector3d corner(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
    const Vector3d point = world_from_target * Vector3d(0.5 * edge_m * corner);
    direct[i] = marker.Project(point);
    if (mirror) mirrored[i] = marker.ProjectMirrored(point);
  }
  for (Projected* p : {direct, mirrored}) {
    marker.Mark({p, p + 1, p + 2, p + 3, p + 4, p + 5, p + 6, p + 7}, kBodies);
  }
}

void MarkSquare(double x, double y, double half, Marker& marker) {
  Projected corners[4];
  for (int i = 0; i < 4; ++i)
    corners[i] = marker.Project({x + (i & 1 ? half : -half), y + (i & 2 ? half : -half), 0});
  marker.Mark({corners, corners + 1, corners + 2, corners + 3}, kMarks);
}

}  // namespace

Image<std::uint8_t> FindContent(const Renderer::State& renderer, const PreparedScene::State& scene,
                                const TrueCamera& camera) {
  Marker marker(camera, renderer.rig.plate);
  const bool mirror = renderer.options.reflections;
  for (const LitMesh& mesh : scene.meshes) MarkMesh(mesh, mirror, marker);
  if (scene.world_from_target)
    MarkCube(*scene.world_from_target, renderer.target.edge_m, mirror, marker);
  if (scene.fiducials) {
    for (const Fiducial& f : renderer.fiducials)
      MarkSquare(f.centre_m.x(), f.centre_m.y(), FiducialPatchHalf(f), marker);
  }
  if (scene.dust) {
    for (const Dust& speck : renderer.dust)
      MarkSquare(speck.centre_m.x(), speck.centre_m.y(), speck.radius_m, marker);
  }
  return marker.Take();
}

}  // namespace sole::sim
