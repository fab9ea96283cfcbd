#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/rig_config.h"
#include "sim/renderer.h"
#include "sim/speckle.h"
#include "sim/tracer_internal.h"

namespace sole::sim {

/// Light of one lamp on one point: where on the lamp's slide it comes from and how strong it is
/// without the slide.
struct LampLight {
  float u = 0, v = 0, weight = 0;
};

struct Lamp {
  Eigen::Vector3d position;
  Eigen::Matrix3d lamp_from_world;
  SpecklePattern slide;
  SpecklePattern skin_slide;  ///< what skin makes of it by scattering light sideways
  double power;  ///< irradiance at 1 m on a white surface that faces the lamp
};

/// Share of a lamp's light that a surface's gloss reflects towards the viewer, relative to a
/// white matt surface: a lobe around the mirror direction that grows at grazing angles. All unit
/// vectors, pointing away from the surface.
float GlossLobe(const Eigen::Vector3f& normal, const Eigen::Vector3f& to_lamp,
                const Eigen::Vector3f& to_viewer);

/// The rig's lamps. Light is computed at chosen points only (mesh vertices, grids on the cube and
/// on the glass), exactly: refraction by the plate, Fresnel losses, distance, cosine, shadow.
/// Between them the place on the slide and the strength are interpolated, so that the pattern is
/// one fixed function of the surface during an exposure.
class Lighting {
 public:
  Lighting(const RigConfig& config, const TruePlate& plate, const RenderOptions& options);

  /// Where light is computed. `two_sided` surfaces scatter light that arrives from behind, too.
  /// `clearance_m` steps over the surface itself; `time` is that of SceneTracer.
  struct Place {
    Eigen::Vector3d point, normal;
    bool two_sided = false;
    double clearance_m = 0;
    float time = 0.5f;
  };

  /// Values per point that At() writes: one per projector, or one in all for texture exposures.
  std::size_t Stride(ExposureKind kind) const;
  /// `panels`, if wanted, receives the irradiance from each of Panels() in a texture exposure.
  void At(const SceneTracer& tracer, ExposureKind kind, const Place& place, LampLight* out,
          float* panels = nullptr) const;
  const std::vector<Lamp>& Projectors() const { return projectors_; }
  const std::vector<Eigen::Vector3d>& Panels() const { return panels_; }
  /// Irradiance on every surface beside that of At().
  float RoomLight() const { return room_light_; }

 private:
  double Strength(const SceneTracer& tracer, const Eigen::Vector3d& lamp, const Place& place,
                  Eigen::Vector3d* leaving) const;

  TruePlate plate_;
  float room_light_;
  std::vector<Lamp> projectors_;
  std::vector<Eigen::Vector3d> panels_;  ///< points that stand for the texture light's panels
};

}  // namespace sole::sim
