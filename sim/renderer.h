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
  double ambient_light = 0.02;  ///< of the room on every surface; 1: full white in 4 ms
  double dot_px = 4;  ///< mean diameter of the speckle's dots in the images, about
  double trigger_jitter_s = 0;  ///< standard deviation of each camera's start of exposure
  std::vector<int> dark_projectors{};  ///< that give no light, from 0; a fault
  bool reuse_background = true;  ///< renders what no body changes once; the images are the same
};

/// CPU seconds of the whole process that the parts of Render() took.
struct RenderTimes {
  double content_s = 0;  ///< which part of the image shows what
  double tracing_s = 0;
  double sensor_s = 0;   ///< blur, vignetting, noise, rounding
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

/// The rig's light, plate and cameras, ray traced: Snell's law at each face of the finite plate,
/// Fresnel losses, shadows, mirror images, speckle or texture light, gloss, motion blur,
/// supersampling, lens blur and defocus, sensor noise. Images do not depend on the number of
/// threads. Safe to use from several threads. Keeps, per camera and kind of exposure, the image of
/// the empty rig, 4 bytes a pixel, once it was needed.
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
  /// Image of camera `camera` (rig order); `seed` of this image's noise and trigger jitter. Adds
  /// to `times` if given. Throws Error for an unknown camera.
  ImageU8 Render(const PreparedScene& scene, int camera, std::uint64_t seed,
                 RenderTimes* times = nullptr) const;

 private:
  std::unique_ptr<const State> state_;
  std::unique_ptr<class Backgrounds> backgrounds_;
};

}  // namespace sole::sim
