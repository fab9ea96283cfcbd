#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/image.h"
#include "core/trigger_bus.h"
#include "sim/camera_server.h"

namespace sole::sim {

inline constexpr int kWidth = 320, kHeight = 240;
inline constexpr int kVariants = 16;

/// Different for every camera, kind, sequence (mod kVariants) and pixel.
inline std::uint8_t Grey(int camera, const TriggerPulse& pulse, std::size_t pixel) {
  const auto sequence =
      static_cast<std::size_t>((pulse.sequence % kVariants + kVariants) % kVariants);
  std::size_t mixed = pixel * 2654435761U + sequence * 40503U +
                      static_cast<std::size_t>(camera) * 977U + pulse.kind * 331U;
  mixed ^= mixed >> 15;
  return static_cast<std::uint8_t>(mixed * 31U >> 3);
}

class RenderedFrames {
 public:
  explicit RenderedFrames(int cameras) {
    for (int camera = 0; camera < cameras; ++camera) {
      for (std::uint32_t kind = 0; kind < 2; ++kind) {
        for (int sequence = 0; sequence < kVariants; ++sequence) {
          ImageU8 image(kWidth, kHeight);
          const TriggerPulse pulse{.sequence = sequence, .scheduled_ns = 0, .kind = kind};
          for (std::size_t i = 0; i < image.pixels.size(); ++i)
            image.pixels[i] = Grey(camera, pulse, i);
          images_.push_back(std::move(image));
        }
      }
    }
  }
  const ImageU8& At(int camera, const TriggerPulse& pulse) const {
    const auto sequence = static_cast<int>((pulse.sequence % kVariants + kVariants) % kVariants);
    return images_[static_cast<std::size_t>(
        (camera * 2 + static_cast<int>(pulse.kind)) * kVariants + sequence)];
  }

 private:
  std::vector<ImageU8> images_;
};

/// A server of small cameras SRV<net>A, B ... on 127.0.<net>.1 onwards.
struct ServedRig {
  ServedRig(int net, int cameras, CameraServerOptions options = {}) : frames(cameras) {
    std::vector<ServedCamera> served;
    for (int i = 0; i < cameras; ++i) {
      served.push_back({.serial = "SRV" + std::to_string(net) + static_cast<char>('A' + i),
                        .address = "127.0." + std::to_string(net) + "." + std::to_string(i + 1),
                        .width = kWidth,
                        .height = kHeight,
                        .exposure_us = 100});
      addresses.push_back(served.back().address);
      serials.push_back(served.back().serial);
    }
    server = std::make_unique<CameraServer>(
        served, 0,
        [this](int camera, const TriggerPulse& pulse) -> const ImageU8& {
          return frames.At(camera, pulse);
        },
        std::move(options));
  }

  RenderedFrames frames;
  std::vector<std::string> addresses, serials;
  std::unique_ptr<CameraServer> server;
};

inline std::int64_t NowNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

}  // namespace sole::sim
