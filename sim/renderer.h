#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include <Eigen/Core>

#include "core/image.h"
#include "core/rig_config.h"
#include "sim/scene.h"
#include "sim/true_rig.h"

namespace sole::sim {

struct RenderOptions {
  double noise = 1.0;       ///< scales photon and read noise; 0 is noise-free
  bool reflections = true;  ///< mirror images in the glass and ghosts of lamps
  std::uint64_t seed = 1;   ///< of slides and dust
  double room_light = 0;    ///< irradiance of the room's lamps on every surface; a fault
  std::vector<int> dark_projectors{};  ///< that give no light, from 0; a fault
};

/// A scene made ready for one exposure: search tree and light on every vertex. Made once, used by
/// all cameras.
class PreparedScene {
 public:
  struct State;
  explicit PreparedScene(std::unique_ptr<const State> state);
  ~PreparedScene();
  PreparedScene(PreparedScene&&) noexcept;
  PreparedScene& operator=(PreparedScene&&) noexcept;
  const State& Get() const { return *state_; }

 private:
  std::unique_ptr<const State> state_;
};

/// What each pixel's central ray meets: mesh (index in the scene, -1 where it meets none) and
/// triangle, barycentric coordinates in it, world position and outward normal (metres; NaN without
/// a mesh), depth along the camera's axis (the refracted light's end point; NaN). Marks and dust on
/// the glass are not considered.
struct TruthMaps {
  Image<std::int32_t> mesh;
  Image<std::int32_t> triangle;
  Image<Eigen::Vector3f> barycentric;
  Image<Eigen::Vector3f> point_m;
  Image<Eigen::Vector3f> normal;
  ImageF depth_m;
};

/// The rig's light, plate and cameras, ray traced: Snell's law at each face of the finite plate,
/// Fresnel losses, shadows, mirror images, speckle or texture light, supersampling, lens blur,
/// sensor noise. Images do not depend on the number of threads. Safe to use from several threads.
class Renderer {
 public:
  struct State;
  /// Throws Error if `config` and `rig` disagree about the cameras.
  Renderer(const RigConfig& config, const TrueRig& rig, const RenderOptions& options = {});
  ~Renderer();

  const TrueRig& Rig() const;
  const State& Get() const { return *state_; }
  /// Copies what it needs. Throws Error if a mesh has indices or attributes of the wrong size.
  PreparedScene Prepare(const Scene& scene) const;
  /// Image of camera `camera` (rig order); `seed` of this image's noise. Throws Error for an
  /// unknown camera.
  ImageU8 Render(const PreparedScene& scene, int camera, std::uint64_t seed) const;
  TruthMaps MapTruth(const PreparedScene& scene, int camera) const;

 private:
  std::unique_ptr<const State> state_;
};

}  // namespace sole::sim
