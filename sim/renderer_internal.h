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
  std::vector<Rigid3> board_from_body;
  std::vector<Fiducial> fiducials;
  std::vector<Dust> dust;
  std::vector<std::vector<int>> dust_cells;  ///< specks by cell of the glass top
};

/// Radiance of one ray: albedo * light + extra.
struct Sample {
  float light = 0;  ///< that falls on the surface, times what the glass lets through
  float extra = 0;  ///< reflections on top of it, or all of a background's radiance
  float albedo = 0;
  int surface = 0;  ///< 0 background, > 0 bodies, < 0 printed or etched: see PrintedAlbedo
  Eigen::Vector2d print = Eigen::Vector2d::Zero();  ///< place on a printed surface, metres

  float Radiance() const { return albedo * light + extra; }
};

inline constexpr int kDustSurface = 1;
inline constexpr int kBareCubeSurface = 2;
inline constexpr int kFirstMeshSurface = 3;
/// Surface numbers of the boards of the cube, and of fiducials.
inline int BoardSurface(int board) {
  return -1 - board;
}
inline int FiducialSurface(int index) {
  return -100 - index;
}
/// Albedo of a printed surface; negative beyond its edge.
float PrintedAlbedo(const Renderer::State& renderer, int surface, const Eigen::Vector2d& print);

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
  Sample ShadeMesh(const LightRay& ray, const SceneHit& hit) const;
  Sample ShadeCube(const SceneHit& hit) const;
  /// Marks and dust on the glass top; of surface 0 where it is clear.
  Sample GlassMark(const Eigen::Vector3d& point) const;
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
