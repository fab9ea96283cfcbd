#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "capture/recorder.h"
#include "core/frame_set.h"
#include "core/rig_config.h"
#include "sim/camera_server.h"
#include "sim/foot.h"
#include "sim/renderer.h"
#include "sim/truth_files.h"

namespace sole::app {

/// Images rendered ahead of time: one set per trigger, one image per camera.
struct RenderedTake {
  ExposureKind kind = ExposureKind::kSpeckle;
  std::string notes;  ///< for take.json
  std::vector<std::vector<ImageU8>> sets;
};

/// A simulated rig (true cameras and plate drawn from `rig_seed`) and a subject who moves before it (`seed`).
/// Development uses seeds below 1000.
class Simulation {
 public:
  Simulation(const RigConfig& config, std::uint64_t rig_seed, std::uint64_t seed);
  Simulation(const RigConfig& config, std::uint64_t seed) : Simulation(config, seed, seed) {}

  const RigConfig& Config() const { return config_; }
  /// Replaces the rig file's faults; those that show in images (docs/faults.md) act on what is
  /// rendered from now on.
  void SetFaults(const std::vector<FaultConfig>& faults);
  /// The calibration cube in `poses` poses, texture light.
  RenderedTake RenderCalibration(int poses);
  /// The speckled contact sheet laid on the glass `times` times, texture light.
  RenderedTake RenderContactSheet(int times);
  /// The subject's motion, `frames` triggers, speckle light. Writes truth maps of every image into the take
  /// `maps`, if given.
  RenderedTake RenderMotion(const std::string& motion, int frames, const std::filesystem::path& maps = {});
  /// Writes truth/ of the take: true rig at the last trigger rendered and, after RenderMotion, true geometry.
  void WriteTruth(const std::filesystem::path& take) const;

 private:
  /// Renders a scene with every camera and appends the images; returns the scene as prepared.
  sim::PreparedScene AppendSet(const sim::Scene& scene, std::uint64_t seed, RenderedTake& take);
  /// The renderer of the rig as it is at this trigger.
  const sim::Renderer& RendererAt(std::int64_t trigger);

  RigConfig config_;
  std::uint64_t rig_seed_, seed_;
  sim::Renderer renderer_;
  std::unique_ptr<sim::Renderer> faulty_;  ///< with the faults below
  std::size_t faults_shown_ = 0;           ///< by faulty_; 0: renderer_ shows the rig as it is
  sim::Subject subject_;
  sim::TakeTruth truth_;  ///< of the motion rendered last
};

/// Serves the rendered images as GigE Vision cameras on loopback; sets are repeated in a cycle.
/// `rendered` must outlive the server.
sim::CameraServer ServeRendered(const RigConfig& config, const RenderedTake& rendered);

/// Serves the images and records them with the real recorder, one trigger per set.
capture::RecordResult RecordRendered(const RigConfig& config, const RenderedTake& rendered,
                                     capture::RecordOptions options);

/// Throws Error if the directory already holds a take.
void RequireNoTake(const std::filesystem::path& directory);

/// Writes a take as the recorder would have, without cameras.
void WriteRendered(const RigConfig& config, const RenderedTake& rendered, const std::filesystem::path& take);

}  // namespace sole::app
