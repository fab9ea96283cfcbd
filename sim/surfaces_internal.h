#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/rig_config.h"
#include "sim/lighting_internal.h"
#include "sim/renderer.h"

namespace sole::sim {

/// A flat patch with light on a regular grid of points.
struct LitGrid {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< world position of node (0, 0)
  Eigen::Vector3d along_x = Eigen::Vector3d::Zero(),
                  along_y = Eigen::Vector3d::Zero();  ///< world, per cell
  int nodes_x = 0, nodes_y = 0;
  std::vector<LampLight> light;  ///< nodes, row by row, times stride
};

struct LitMesh {
  std::vector<Eigen::Vector3i> triangles;
  std::vector<Eigen::Vector3d> vertices;  ///< at the middle of the exposure
  std::vector<Eigen::Vector3d> shifts;    ///< way from there to the shutter's closing; empty at rest
  std::vector<Eigen::Vector3f> normals;
  std::vector<Eigen::Vector3f> material;
  std::vector<float> tone;
  /// Vertices times stride, as the shutter opens and closes; the second is empty at rest.
  std::vector<LampLight> light, light_close;
  std::vector<float> panels;  ///< vertices times panels, at the opening; texture exposures only
};

/// A speck on the glass top.
struct Dust {
  Eigen::Vector2d centre_m;
  double radius_m;
};

/// The contact sheet with its print and light, lower side first.
struct LitSheet {
  ContactSheet sheet;
  SpecklePattern print;
  std::array<LitGrid, 2> sides;

  /// Place on the sheet of a world point, metres from its middle.
  Eigen::Vector2d OnSheet(const Eigen::Vector3d& point) const;
  bool Covers(const Eigen::Vector2d& place) const;
};

struct PreparedScene::State {
  State(const Scene& scene, double cube_edge_m,
        const std::vector<std::vector<Eigen::Vector3d>>& shifts)
      : tracer(scene, cube_edge_m, shifts) {}
  SceneTracer tracer;
  ExposureKind exposure = ExposureKind::kSpeckle;
  std::optional<Rigid3> world_from_target;
  bool fiducials = true;
  bool dust = true;
  PlateSag sag;
  std::size_t stride = 0;
  std::vector<LitMesh> meshes;
  std::vector<LitGrid> cube;  ///< faces -x +x -y +y -z +z
  std::optional<LitSheet> sheet;
  LitGrid glass;              ///< the plate's top face
};

/// Light per vertex and grid node; the part of Renderer::Prepare that computes.
void LightMesh(const Lighting& lighting, const SceneTracer& tracer, ExposureKind kind,
               LitMesh& mesh);
LitGrid LightCubeFace(const Lighting& lighting, const SceneTracer& tracer, ExposureKind kind,
                      const Rigid3& world_from_body, double edge_m, int face);
LitGrid LightGlass(const Lighting& lighting, const SceneTracer& tracer, ExposureKind kind,
                   const TruePlate& plate);
LitSheet LightSheet(const Lighting& lighting, const SceneTracer& tracer, ExposureKind kind,
                    const ContactSheet& sheet);

/// Light on a surface point: what falls on it, room light included, and what its gloss reflects.
struct MixedLight {
  float diffuse = 0;
  float gloss = 0;
};
/// Light that a lamp's slide lets through, summed over lamps, with the points' light mixed by
/// weights. `gloss`: per lamp the factor of GlossLobe, in texture exposures the radiance itself;
/// null where there is none.
struct WeightedPoint {
  const LampLight* light;
  const float* gloss;
  float weight;
};
MixedLight MixLight(const Lighting& lighting, ExposureKind kind, bool skin,
                    const WeightedPoint* points, int count);
/// Light on a grid at cell coordinates x, y (clamped to the grid).
float GridLight(const Lighting& lighting, ExposureKind kind, std::size_t stride,
                const LitGrid& grid, double x, double y);

/// Mean diffuse reflectance of skin, and its relative change at a material point (mean 1): blotches,
/// creases, pores.
inline constexpr float kSkinAlbedo = 0.50f;
float SkinTexture(const Eigen::Vector3f& material_m);

/// Specks spread at random over the plate.
std::vector<Dust> ScatterDust(const TruePlate& plate, std::uint64_t seed);
/// Cell of a point of the glass top, and the specks that reach into each cell.
std::size_t DustCell(const TruePlate& plate, double x, double y);
std::vector<std::vector<int>> SortDust(const TruePlate& plate, const std::vector<Dust>& specks);

}  // namespace sole::sim
