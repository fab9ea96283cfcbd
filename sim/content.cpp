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
constexpr double kStill_m = 4e-5;  // a fifth of a pixel: moves that do not show

class Marker {
 public:
  Marker(const TrueCamera& camera, const TruePlate& plate)
      : camera_(camera),
        plate_(plate),
        doubled_(plate),
        centre_(camera.Centre()),
        blocks_((camera.width + kBlock - 1) / kBlock, (camera.height + kBlock - 1) / kBlock,
                kNothing),
        depth_(blocks_.width, blocks_.height, 0.0f) {
    doubled_.thickness_m *= 2;
  }

  /// How a point may be seen: directly or mirrored by either face of the glass.
  enum class Way { kDirect, kUpperFace, kLowerFace };
  Projected Project(const Vector3d& point, Way way = Way::kDirect) const {
    const Vector3d mirrored(point.x(), point.y(), -point.z());
    if (way == Way::kDirect)
      return PixelOfDirection(camera_, PathBetween(plate_, centre_, point).leaving);
    if (way == Way::kUpperFace) return PixelOfDirection(camera_, mirrored - centre_);
    // Down and up again through the glass is like straight on through twice as much of it.
    return PixelOfDirection(
        camera_, PathBetween(doubled_, centre_,
                             mirrored - Vector3d(0, 0, doubled_.thickness_m)).leaving);
  }
  bool SeesMirrorImages() const { return centre_.z() > 0; }
  float Depth(const Vector3d& point) const {
    return static_cast<float>((camera_.cam_from_world * point).z());
  }
  /// Marks the blocks that a hull of image points covers, by its bounding box.
  void Mark(std::initializer_list<const Projected*> points, unsigned content, float depth_m) {
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
      for (int x = x0; x <= x1; ++x) {
        blocks_.At(x, y) |= static_cast<std::uint8_t>(content);
        float& depth = depth_.At(x, y);
        if (depth_m > 0 && !(depth > 0 && depth < depth_m)) depth = depth_m;
      }
    }
  }
  Image<std::uint8_t>& Blocks() { return blocks_; }
  ImageF& Depths() { return depth_; }

 private:
  const TrueCamera& camera_;
  const TruePlate& plate_;
  TruePlate doubled_;
  Vector3d centre_;
  Image<std::uint8_t> blocks_;
  ImageF depth_;
};

void MarkMesh(const LitMesh& mesh, bool mirror, double exposed, Marker& marker) {
  const std::size_t count = mesh.vertices.size();
  const bool moves = !mesh.shifts.empty();
  std::vector<Projected> open(count), close(moves ? count : 0);
  std::vector<Marker::Way> ways = {Marker::Way::kDirect};
  if (mirror && marker.SeesMirrorImages()) {
    ways.insert(ways.end(), {Marker::Way::kUpperFace, Marker::Way::kLowerFace});
  }
  for (const Marker::Way way : ways) {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 1024), [&](const auto& range) {
      for (std::size_t i = range.begin(); i < range.end(); ++i) {
        open[i] = marker.Project(moves ? mesh.vertices[i] - mesh.shifts[i] : mesh.vertices[i], way);
        if (moves) close[i] = marker.Project(mesh.vertices[i] + mesh.shifts[i], way);
      }
    });
    for (const Eigen::Vector3i& t : mesh.triangles) {
      const auto a = static_cast<std::size_t>(t[0]), b = static_cast<std::size_t>(t[1]),
                 c = static_cast<std::size_t>(t[2]);
      const float depth = way == Marker::Way::kDirect ? marker.Depth(mesh.vertices[a]) : 0;
      if (!moves) {
        marker.Mark({&open[a], &open[b], &open[c]}, kBodies, depth);
        continue;
      }
      const double way_m =
          2 * exposed *
          std::max({mesh.shifts[a].norm(), mesh.shifts[b].norm(), mesh.shifts[c].norm()});
      marker.Mark({&open[a], &open[b], &open[c], &close[a], &close[b], &close[c]},
                  way_m > kStill_m ? kBodies | kMoving : kBodies, depth);
    }
  }
}

void MarkCube(const Rigid3& world_from_target, double edge_m, bool mirror, Marker& marker) {
  std::vector<Marker::Way> ways = {Marker::Way::kDirect};
  if (mirror && marker.SeesMirrorImages()) {
    ways.insert(ways.end(), {Marker::Way::kUpperFace, Marker::Way::kLowerFace});
  }
  for (const Marker::Way way : ways) {
    Projected p[8];
    for (int i = 0; i < 8; ++i) {
      const Vector3d corner(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
      p[i] = marker.Project(world_from_target * Vector3d(0.5 * edge_m * corner), way);
    }
    marker.Mark({p, p + 1, p + 2, p + 3, p + 4, p + 5, p + 6, p + 7}, kBodies,
                way == Marker::Way::kDirect ? marker.Depth(world_from_target.translation) : 0);
  }
}

void MarkSheet(const LitSheet& sheet, Marker& marker) {
  for (const LitGrid& side : sheet.sides) {
    // By cells of the light's grid: lines bend little within them.
    for (int i = 0; i + 1 < side.nodes_y; ++i) {
      for (int j = 0; j + 1 < side.nodes_x; ++j) {
        Projected p[4];
        const Vector3d corner = side.origin + j * side.along_x + i * side.along_y;
        for (int k = 0; k < 4; ++k) {
          p[k] = marker.Project(corner + (k & 1) * side.along_x + (k >> 1) * side.along_y);
        }
        marker.Mark({p, p + 1, p + 2, p + 3}, kBodies, marker.Depth(corner));
      }
    }
  }
}

/// Whether bodies change the light on any node of the glass around a square.
bool LightChanges(const LitGrid& glass, const LitGrid& empty, std::size_t stride, double x,
                  double y, double half) {
  const auto cell = [](double value, int nodes) {
    return std::clamp(static_cast<int>(std::floor(value)), 0, nodes - 2);
  };
  const int x0 = cell((x - half - glass.origin.x()) / glass.along_x.x(), glass.nodes_x),
            x1 = cell((x + half - glass.origin.x()) / glass.along_x.x(), glass.nodes_x),
            y0 = cell((y - half - glass.origin.y()) / glass.along_y.y(), glass.nodes_y),
            y1 = cell((y + half - glass.origin.y()) / glass.along_y.y(), glass.nodes_y);
  for (int row = y0; row <= y1 + 1; ++row) {
    const auto first = static_cast<std::size_t>(row * glass.nodes_x + x0) * stride,
               last = static_cast<std::size_t>(row * glass.nodes_x + x1 + 2) * stride;
    for (std::size_t i = first; i < last; ++i) {
      const LampLight &a = glass.light[i], &b = empty.light[i];
      if (a.u != b.u || a.v != b.v || a.weight != b.weight) return true;
    }
  }
  return false;
}

/// A view's gloss on one mesh, at the middle of the exposure.
std::vector<float> MeshGloss(const Renderer::State& renderer, const PreparedScene::State& scene,
                             const LitMesh& mesh, const TrueCamera& camera) {
  constexpr double kWet_m = 2e-4;  // skin this near the glass is wetted to it
  const Lighting& lighting = renderer.lighting;
  const bool texture = scene.exposure == ExposureKind::kTexture;
  const std::size_t lamps = texture ? lighting.Panels().size() : scene.stride;
  const Vector3d centre = camera.Centre();
  std::vector<float> gloss(mesh.vertices.size() * scene.stride, 0.0f);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, mesh.vertices.size(), 512),
                    [&](const auto& range) {
    for (std::size_t v = range.begin(); v < range.end(); ++v) {
      const Vector3d& point = mesh.vertices[v];
      if (point.z() < kWet_m) continue;
      // Straight, though glass may lie between: the lobe is wider than what that bends.
      const Eigen::Vector3f to_viewer = (centre - point).normalized().cast<float>();
      if (!(mesh.normals[v].dot(to_viewer) > 0)) continue;
      for (std::size_t lamp = 0; lamp < lamps; ++lamp) {
        const float light = texture ? mesh.panels[v * lamps + lamp]
                                    : mesh.light[v * lamps + lamp].weight;
        if (!(light > 0)) continue;
        const Vector3d& from =
            texture ? lighting.Panels()[lamp] : lighting.Projectors()[lamp].position;
        const float lobe = GlossLobe(mesh.normals[v], (from - point).normalized().cast<float>(),
                                     to_viewer);
        if (texture) gloss[v] += light * lobe;
        else gloss[v * lamps + lamp] = lobe;
      }
    }
  });
  return gloss;
}

}  // namespace

SceneView ViewScene(const Renderer::State& renderer, const PreparedScene::State& scene,
                    const TrueCamera& camera, const LitGrid& empty_glass) {
  SceneView view;
  Marker marker(camera, renderer.rig.plate);
  const bool mirror = renderer.options.reflections;
  const double exposed = camera.exposure_s / renderer.shutter_s;
  for (const LitMesh& mesh : scene.meshes) {
    MarkMesh(mesh, mirror, exposed, marker);
    view.gloss.push_back(MeshGloss(renderer, scene, mesh, camera));
  }
  if (scene.world_from_target)
    MarkCube(*scene.world_from_target, renderer.target.edge_m, mirror, marker);
  if (scene.sheet) MarkSheet(*scene.sheet, marker);
  const auto mark_square = [&](double x, double y, double half) {
    Projected p[4];
    for (int i = 0; i < 4; ++i)
      p[i] = marker.Project({x + (i & 1 ? half : -half), y + (i & 2 ? half : -half), 0});
    // Marks of a bent glass stand elsewhere than in the empty rig.
    const bool changes = scene.sag.At(x, y) != 0 ||
                         LightChanges(scene.glass, empty_glass, scene.stride, x, y, half);
    marker.Mark({p, p + 1, p + 2, p + 3}, changes ? kMarks | kChangedMarks : kMarks,
                marker.Depth({x, y, 0}));
  };
  if (scene.fiducials) {
    for (const Fiducial& f : renderer.fiducials)
      mark_square(f.centre_m.x(), f.centre_m.y(), FiducialPatchHalf(f));
  }
  if (scene.dust) {
    for (const Dust& speck : renderer.dust)
      mark_square(speck.centre_m.x(), speck.centre_m.y(), speck.radius_m);
  }
  view.blocks = std::move(marker.Blocks());
  view.depth_m = std::move(marker.Depths());
  return view;
}

}  // namespace sole::sim
