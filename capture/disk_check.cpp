#include "capture/disk_check.h"

#include <algorithm>
#include <limits>
#include <string>
#include <system_error>

#include "core/error.h"
#include "io/disk_rate.h"
#include "io/raw_file.h"

namespace sole::capture {

namespace fs = std::filesystem;

namespace {

constexpr double kMega = 1e6;
constexpr double kAnyDisk = 20 * kMega;

std::string Megabytes(double bytes) {
  return std::to_string(static_cast<long long>(bytes / kMega)) + " MB";
}

}  // namespace

double WriteRateNeeded(const RigConfig& config) {
  double frame_set = 0;
  for (const CameraConfig& camera : config.cameras)
    frame_set += static_cast<double>(camera.width) * camera.height + 2 * io::kRawBlock;
  return frame_set * config.trigger.rate_hz * static_cast<double>(config.trigger.exposures.size());
}

double RoomLeft(const fs::path& directory, const DiskConfig& disk) {
  std::error_code error;
  const fs::space_info space = fs::space(directory, error);
  if (error) return std::numeric_limits<double>::infinity();
  return static_cast<double>(space.available) - disk.reserve_mb * kMega;
}

double MeasureDisk(const fs::path& directory, const RigConfig& config) {
  io::WriteRateOptions options;
  options.files = static_cast<int>(config.cameras.size());
  options.frame_bytes = static_cast<std::size_t>(config.cameras.front().width) *
                        static_cast<std::size_t>(config.cameras.front().height);
  if (config.disk.write_test_mb > 0) {
    options.max_bytes = static_cast<std::uint64_t>(config.disk.write_test_mb * kMega);
  }
  return io::MeasureWriteRate(directory, options);
}

void RequireDisk(const fs::path& directory, const RigConfig& config, double bytes) {
  const double room = RoomLeft(directory, config.disk);
  Require(room >= bytes * 1.02,
          "too little room for the take in " + directory.string() + ": " +
              Megabytes(bytes * 1.02 + config.disk.reserve_mb * kMega) + " needed, " +
              Megabytes(std::max(0.0, room + config.disk.reserve_mb * kMega)) +
              " free: delete something or record fewer triggers");
  const double rate = WriteRateNeeded(config);
  if (rate < kAnyDisk || config.disk.write_test_mb <= 0) return;
  const double measured = MeasureDisk(directory, config);
  Require(measured * config.disk.max_share >= rate,
          "the disk of " + directory.string() + " is too slow: recording writes " +
              Megabytes(rate) + "/s, the disk takes " + Megabytes(measured) +
              "/s, of which disk max_share allows " + Megabytes(measured * config.disk.max_share) +
              "/s: lower rate_hz or the image size, or use a faster disk");
}

}  // namespace sole::capture
