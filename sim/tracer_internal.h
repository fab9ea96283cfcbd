#pragma once

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

/// Meshes (Embree) and the calibration cube (exact, double precision) without any glass.
class SceneTracer {
 public:
  SceneTracer(const Scene& scene, double cube_edge_m);
  ~SceneTracer();
  SceneTracer(const SceneTracer&) = delete;
  SceneTracer& operator=(const SceneTracer&) = delete;

  /// The ray must start outside of all bodies or on their surface with `from_m` to step over it.
  SceneHit Nearest(const LightRay& ray, double from_m = 0) const;
  /// True if something lies on the ray between from_m and to_m.
  bool Blocked(const LightRay& ray, double from_m, double to_m) const;

 private:
  SceneHit HitCube(const LightRay& ray, double from_m) const;

  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;  ///< null without meshes
  std::optional<Rigid3> cube_from_world_;
  double cube_half_m_;
};

}  // namespace sole::sim
