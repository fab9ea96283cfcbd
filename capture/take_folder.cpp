#include <system_error>

#include "capture/disk_check.h"
#include "capture/take_folder_internal.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/raw_file.h"

namespace sole::capture {

namespace fs = std::filesystem;

TakeFolder::TakeFolder(const fs::path& directory, const RigConfig& config, double bytes) : paths_{directory} {
  std::error_code error;
  const bool exists = fs::exists(directory, error);
  Require(!exists || fs::is_directory(directory, error),
          directory.string() + " is a file: choose another place for the take");
  Require(!exists || fs::is_empty(directory, error),
          "take directory " + directory.string() +
              " is not empty: choose another name, nothing is overwritten");
  if (!exists) {
    io::MakeDirectory(directory);
    created_ = true;
  }
  try {
    io::MakeDirectory(directory / "cameras");
    const fs::path probe = directory / "cameras" / "write-test";
    io::WriteStringAtomically(probe, "x");
    fs::remove(probe, error);
    if (bytes > 0) RequireDisk(directory / "cameras", config, bytes);
  } catch (...) {
    fs::remove(directory / "cameras", error);
    if (created_) fs::remove(directory, error);
    throw;
  }
}

TakeFolder::~TakeFolder() {
  if (keep_) return;
  std::error_code ignored;
  fs::remove_all(paths_.root / "cameras", ignored);
  for (const fs::path& file : {paths_.Info(), paths_.RigFile(), paths_.Triggers()})
    fs::remove(file, ignored);
  if (created_) fs::remove(paths_.root, ignored);
}

double BytesNeeded(const RigConfig& config, std::int64_t triggers) {
  double bytes = 0;
  for (const CameraConfig& camera : config.cameras)
    bytes += static_cast<double>(camera.width) * camera.height + 2 * io::kRawBlock;
  return bytes * static_cast<double>(triggers);
}

std::vector<io::TriggerRecord> TriggerRecords(const std::vector<TriggerEdge>& edges,
                                              double exposure_s,
                                              const std::vector<ExposureEcho>* echoes) {
  std::vector<io::TriggerRecord> records;
  if (edges.empty()) return records;
  const std::int64_t zero = edges.front().scheduled_ns;
  const auto seconds = [&](std::int64_t ns) { return static_cast<double>(ns - zero) * 1e-9; };
  std::size_t echo = 0;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    io::TriggerRecord record;
    record.trigger = static_cast<std::int64_t>(i) + 1;
    record.kind = edges[i].kind;
    record.scheduled_s = seconds(edges[i].scheduled_ns);
    record.actual_s = seconds(edges[i].actual_ns);
    record.exposure_start_s = record.actual_s;
    record.exposure_end_s = record.actual_s + exposure_s;
    if (echoes != nullptr) {
      record.exposure_end_s = record.actual_s;
      while (echo < echoes->size() && (*echoes)[echo].start_ns < edges[i].actual_ns) ++echo;
      const bool ours =
          echo < echoes->size() &&
          (i + 1 == edges.size() || (*echoes)[echo].start_ns < edges[i + 1].actual_ns);
      if (ours) {
        record.exposure_start_s = seconds((*echoes)[echo].start_ns);
        record.exposure_end_s = seconds((*echoes)[echo].end_ns);
      }
    }
    records.push_back(record);
  }
  return records;
}

}  // namespace sole::capture
