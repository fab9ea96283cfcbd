#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <vector>

#include "capture/camera.h"
#include "capture/frame_matcher.h"
#include "capture/trigger.h"

namespace sole::capture {

using CameraList = std::vector<std::unique_ptr<Camera>>;

/// Stops and closes all cameras side by side: one that went away takes seconds to give up.
void CloseCameras(CameraList& cameras);

struct WarmUpOptions {
  int triggers = 3;  ///< per attempt, before the synchronising one
  int attempts = 5;
  std::int64_t period_ns = 100'000'000;
  const std::atomic<bool>* stop = nullptr;
};

struct WarmUpAnswer {
  bool answered = false;  ///< exactly one whole frame came for the synchronising edge
  int incomplete = 0;     ///< frames with holes over all attempts
  CameraSync sync;        ///< valid if answered
  double latency_s = 0;   ///< edge to whole frame
};

/// Fires warm-up edges (sequences up to 0), whose first frames are often lost, lets the cameras
/// fall silent, then fires one more edge to which every camera must answer with one whole frame;
/// tries again while one does not. That frame ties each camera's ids and clock to the host's. The
/// cameras must be streaming; their handlers are cleared at the end. Returns early, with nothing
/// answered, when `stop` becomes true.
std::vector<WarmUpAnswer> WarmUp(const CameraList& cameras, Trigger& trigger,
                                 const WarmUpOptions& options);

}  // namespace sole::capture
