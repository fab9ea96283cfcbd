#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "core/image.h"
#include "core/rig_config.h"
#include "sim/camera_server.h"

namespace sole::capture {

/// Small simulated cameras on 127.0.`net`.11 onwards whose images tell camera and trigger: the
/// first 16 pixels spell them, the others follow from them.
class SimulatedRig {
 public:
  SimulatedRig(int net, int cameras, sim::CameraServerOptions options = {}) {
    config.name = "test";
    std::vector<sim::ServedCamera> served;
    for (int i = 0; i < cameras; ++i) {
      CameraConfig camera;
      camera.serial = "T" + std::to_string(net) + "C" + std::to_string(i + 1);
      camera.address = "127.0." + std::to_string(net) + "." + std::to_string(11 + i);
      camera.width = 320;
      camera.height = 96;
      camera.focal_px = 500;
      camera.look_at_m = {0, 1, 0};
      config.cameras.push_back(camera);
      served.push_back(
          {.serial = camera.serial, .address = camera.address, .width = 320, .height = 96});
    }
    config.trigger.rate_hz = 20;
    config.trigger.warmup = 2;
    server = std::make_unique<sim::CameraServer>(
        served, 0,
        [this](int camera, const TriggerPulse& pulse) -> const ImageU8& {
          return Image(camera, pulse);
        },
        options);
    config.trigger.bus_port = server->BusPort();
  }

  static ImageU8 Draw(int camera, std::int64_t trigger) {
    ImageU8 image(320, 96);
    std::uint32_t state = static_cast<std::uint32_t>(camera * 7919 + trigger * 104729);
    for (auto& pixel : image.pixels) {
      state = state * 1664525U + 1013904223U;
      pixel = static_cast<std::uint8_t>(state >> 24);
    }
    return image;
  }

  RigConfig config;
  std::unique_ptr<sim::CameraServer> server;

 private:
  const ImageU8& Image(int camera, const TriggerPulse& pulse) {
    const std::lock_guard lock(mutex_);
    auto& image = images_[{camera, pulse.sequence}];
    if (!image) image = std::make_unique<ImageU8>(Draw(camera, pulse.sequence));
    return *image;
  }

  std::mutex mutex_;
  std::map<std::pair<int, std::int64_t>, std::unique_ptr<ImageU8>> images_;
};

}  // namespace sole::capture
