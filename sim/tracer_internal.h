#pragma once

#include <array>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <embree3/rtcore.h>

#include "core/rigid3.h"
#include "sim/light_path.h"
#include "sim/scene.h"

namespace sole::sim {

/// What a ray meets first.
struct SceneHit {
  enum class Kind { kNone, kMesh, kCube };
  Kind kind = Kind::kNone;
  double distance_m = 0;
  int mesh = -1;
  int triangle = -1;
  float b1 = 0, b2 = 0;     ///< barycentric weights of the triangle's second and third vertex
  int face = -1;            ///< of the cube: -x +x -y +y -z +z
  Eigen::Vector3d in_body;  ///< hit point on the cube, body frame
};

/// Meshes (Embree) and the calibration cube (exact, double precision) without any glass. Time runs
/// from 0 to 1 while a mesh moves straight from `vertices - shifts` to `vertices + shifts`.
class SceneTracer {
 public:
  /// `shifts`: per mesh one per vertex, or none where it rests; empty if all meshes rest.
  SceneTracer(const Scene& scene, double cube_edge_m,
              const std::vector<std::vector<Eigen::Vector3d>>& shifts = {});
  ~SceneTracer();
  SceneTracer(const SceneTracer&) = delete;
  SceneTracer& operator=(const SceneTracer&) = delete;

  /// The ray must start outside of all bodies or on their surface with `from_m` to step over it.
  SceneHit Nearest(const LightRay& ray, double from_m = 0, float time = 0.5f) const;
  /// The same for four rays that lead almost the same way; without motion.
  std::array<SceneHit, 4> NearestOfFour(const std::array<LightRay, 4>& rays) const;
  /// True if something lies on the ray between from_m and to_m.
  bool Blocked(const LightRay& ray, double from_m, double to_m, float time = 0.5f) const;

 private:
  SceneHit HitCube(const LightRay& ray, double from_m) const;

  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;  ///< null without meshes
  std::optional<Rigid3> cube_from_world_;
  double cube_half_m_;
};

}  // namespace sole::sim
