#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/image.h"
#include "core/rig_config.h"
#include "io/raw_file.h"
#include "io/rig_file.h"
#include "io/take.h"

namespace sole::testing_support {

/// A rig of `count` cameras with small images.
inline RigConfig TinyRig(int count, int width = 64, int height = 64) {
  RigConfig config = MakeDefaultRig(4, width, height);
  config.cameras.resize(static_cast<std::size_t>(count));
  config.pairs.clear();
  return config;
}

/// The only image that may be found under this camera and trigger.
inline ImageU8 TinyImage(const RigConfig& config, std::size_t camera, std::int64_t trigger) {
  ImageU8 image(config.cameras[camera].width, config.cameras[camera].height);
  auto state =
      static_cast<std::uint32_t>(camera * 7919 + static_cast<std::uint64_t>(trigger) * 104729);
  for (std::uint8_t& pixel : image.pixels) {
    state = state * 1664525U + 1013904223U;
    pixel = static_cast<std::uint8_t>(state >> 24);
  }
  return image;
}

inline ExposureKind TinyKind(std::int64_t trigger) {
  return trigger % 3 == 0 ? ExposureKind::kTexture : ExposureKind::kSpeckle;
}

/// Every tenth of a second, 1 ms late, on a camera clock that is 123 s and its place ahead.
inline io::RawRecordHeader TinyHeader(const RigConfig& config, std::size_t camera,
                                      std::int64_t trigger) {
  return {.trigger = trigger,
          .frame_id = static_cast<std::uint64_t>(trigger + 5),
          .device_time_ns = 123'000'000'000 + camera * 1'000'000'000 +
                            static_cast<std::uint64_t>(trigger - 1) * 100'000'000 + 1'000'000,
          .host_time_ns = 1'700'000'000'000'000'000 + trigger,
          .width = static_cast<std::uint32_t>(config.cameras[camera].width),
          .height = static_cast<std::uint32_t>(config.cameras[camera].height),
          .kind = TinyKind(trigger)};
}

inline io::TriggerRecord TinyTrigger(std::int64_t trigger) {
  const double at = 0.1 * static_cast<double>(trigger - 1);
  const double exposure_s = 1e-6 * CameraConfig{}.exposure_us;
  return {trigger, TinyKind(trigger), at, at + 1e-3, at + 1e-3, at + 1e-3 + exposure_s};
}

/// take.json, rig.toml and triggers.csv as a recorder writes them first.
inline io::TakePaths BeginTake(const std::filesystem::path& root, const RigConfig& config) {
  const io::TakePaths take{root};
  std::filesystem::create_directories(root / "cameras");
  io::WriteRigFile(take.RigFile(), config);
  io::WriteTriggers(take, {});
  io::TakeInfo info;
  info.name = "tiny";
  info.subject = "P01";
  info.rig_hash = RigIdentityHash(config);
  io::WriteTakeInfo(take, info);
  return take;
}

/// A closed take of `triggers` triggers without losses.
inline io::TakePaths WriteTinyTake(const std::filesystem::path& root, const RigConfig& config,
                                   std::int64_t triggers) {
  const io::TakePaths take = BeginTake(root, config);
  std::vector<io::TriggerRecord> lines;
  for (std::int64_t t = 1; t <= triggers; ++t) lines.push_back(TinyTrigger(t));
  io::WriteTriggers(take, lines);
  for (std::size_t c = 0; c < config.cameras.size(); ++c) {
    io::RawFileWriter writer(take.Raw(config.cameras[c].serial), config.cameras[c].serial);
    for (std::int64_t t = 1; t <= triggers; ++t)
      writer.Append(TinyHeader(config, c, t), TinyImage(config, c, t).pixels.data());
    writer.Close();
  }
  io::TakeInfo info = io::ReadTakeInfo(take);
  info.state = "complete";
  info.verdict = "good";
  io::WriteTakeInfo(take, info);
  return take;
}

}  // namespace sole::testing_support
