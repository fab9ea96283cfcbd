#pragma once

#include <filesystem>

#include "core/rig.h"
#include "core/rig_config.h"
#include "io/calibration_file.h"
#include "io/raw_file.h"
#include "io/rig_file.h"
#include "io/take.h"

namespace sole::testing_support {

/// Four small cameras on loopback addresses nobody serves.
inline RigConfig SmallRig() {
  RigConfig config = MakeDefaultRig(4, 160, 120);
  config.name = "small";
  for (std::size_t i = 0; i < config.cameras.size(); ++i) {
    config.cameras[i].address = "127.0.91." + std::to_string(i + 1);
  }
  config.trigger.bus_port = 17911;
  return config;
}

/// Writes a complete take of dark images.
inline void WriteDarkTake(const std::filesystem::path& directory, const RigConfig& config, int triggers) {
  const io::TakePaths take{directory};
  std::filesystem::create_directories(directory / "cameras");
  io::TakeInfo info;
  info.name = directory.filename().string();
  info.rig_hash = RigIdentityHash(config);
  info.state = "complete";
  info.verdict = "good";
  io::WriteTakeInfo(take, info);
  io::WriteRigFile(take.RigFile(), config);
  std::vector<io::TriggerRecord> records;
  for (int t = 1; t <= triggers; ++t) records.push_back({t, ExposureKind::kSpeckle, 0.1 * t, 0.1 * t, 0.1 * t, 0.1 * t});
  io::WriteTriggers(take, records);
  for (const CameraConfig& camera : config.cameras) {
    const ImageU8 image(camera.width, camera.height, 3);
    io::RawFileWriter writer(take.Raw(camera.serial), camera.serial);
    for (int t = 1; t <= triggers; ++t) {
      io::RawRecordHeader header;
      header.trigger = t;
      header.frame_id = static_cast<std::uint64_t>(t);
      header.width = static_cast<std::uint32_t>(camera.width);
      header.height = static_cast<std::uint32_t>(camera.height);
      writer.Append(header, image.pixels.data());
    }
    writer.Close();
  }
}

/// The nominal rig as if it had been calibrated.
inline Calibration NominalCalibration(const RigConfig& config) {
  Calibration calibration;
  for (const CameraConfig& c : config.cameras) {
    Camera camera{c.serial, c.width, c.height, {}, NominalCamFromWorld(c)};
    camera.intrinsics << c.focal_px, c.focal_px, 0.5 * (c.width - 1), 0.5 * (c.height - 1), 0, 0, 0, 0, 0;
    calibration.rig.cameras.push_back(camera);
  }
  for (const PairConfig& pair : config.pairs) {
    calibration.rig.pairs.push_back({pair.name, CameraIndex(config, pair.left), CameraIndex(config, pair.right)});
  }
  calibration.rig.rig_hash = RigIdentityHash(config);
  const auto size = static_cast<Eigen::Index>(15 * config.cameras.size() + 1);
  calibration.covariance = 1e-8 * Eigen::MatrixXd::Identity(size, size);
  calibration.stats.camera_rms_px.assign(config.cameras.size(), 0.05);
  calibration.stats.camera_corners.assign(config.cameras.size(), 1000);
  calibration.created = "2026-01-01T00:00:00Z";
  return calibration;
}

}  // namespace sole::testing_support
