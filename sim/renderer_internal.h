#pragma once

#include <vector>

#include "core/target.h"
#include "sim/light_path.h"
#include "sim/surfaces_internal.h"

namespace sole::sim {

struct Renderer::State {
  State(const RigConfig& config, const TrueRig& true_rig, const RenderOptions& render_options);

  TrueRig rig;
  RenderOptions options;
  Lighting lighting;
  CalibrationBody target;
  std::vector<int> target_face;  ///< of cube face -x +x -y +y -z +z; -1 for a bare one
  std::vector<Fiducial> fiducials;
  std::vector<Dust> dust;
  std::vector<std::vector<int>> dust_cells;  ///< specks by cell of the glass top
};

/// Radiance of one ray and whether what it met has hard edges.
struct Sample {
  float radiance = 0;
  int surface = 0;  ///< tells different surfaces apart: 0 background, 1 glass mark, 2.. bodies
};

/// Follows light from a camera back to its source.
class PathTracer {
 public:
  PathTracer(const Renderer::State& renderer, const PreparedScene::State& scene)
      : r_(renderer), s_(scene) {}
  /// `bodies` false skips meshes and the cube (where none can be seen).
  Sample Trace(const LightRay& ray, bool bodies) const;

 private:
  Sample FromBelow(const LightRay& ray, bool bodies) const;
  Sample FromAbove(const LightRay& ray, bool bodies) const;
  Sample Shade(const LightRay& ray, const SceneHit& hit) const;
  float ShadeMesh(const LightRay& ray, const SceneHit& hit) const;
  float ShadeCube(const SceneHit& hit) const;
  /// Radiance of marks and dust on the glass top; negative where it is clear.
  float GlassMark(const Eigen::Vector3d& point) const;
  /// Room, and lamps that shine into the camera.
  float Background(const LightRay& ray) const;
  float LampGlare(const LightRay& ray) const;

  const Renderer::State& r_;
  const PreparedScene::State& s_;
};

/// Which blocks of kBlock x kBlock pixels can show what.
inline constexpr int kBlock = 8;
enum BlockContent : std::uint8_t { kNothing = 0, kMarks = 1, kBodies = 2 };
Image<std::uint8_t> FindContent(const Renderer::State& renderer, const PreparedScene::State& scene,
                                const TrueCamera& camera);

}  // namespace sole::sim
