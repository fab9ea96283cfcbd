#include <system_error>

#include "capture/take_folder_internal.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/raw_file.h"

namespace sole::capture {

namespace fs = std::filesystem;

namespace {

constexpr double kMarginBytes = 64.0 * 1024 * 1024;

std::string Megabytes(double bytes) {
  return std::to_string(static_cast<long long>(bytes / 1e6)) + " MB";
}

void RequireRoom(const fs::path& directory, double bytes) {
  std::error_code error;
  const fs::space_info space = fs::space(directory, error);
  const double needed = bytes * 1.02 + kMarginBytes;
  Require(error || static_cast<double>(space.available) >= needed,
          "too little room for the take in " + directory.string() + ": " + Megabytes(needed) +
              " needed, " + Megabytes(static_cast<double>(space.available)) +
              " free: delete something or record fewer triggers");
}

}  // namespace

TakeFolder::TakeFolder(const fs::path& directory, double bytes) : paths_{directory} {
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
    RequireRoom(directory, bytes);
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
                                              double exposure_s) {
  std::vector<io::TriggerRecord> records;
  for (const TriggerEdge& edge : edges) {
    io::TriggerRecord record;
    record.trigger = edge.sequence;
    record.kind = edge.kind;
    record.scheduled_s = static_cast<double>(edge.scheduled_ns - edges.front().scheduled_ns) * 1e-9;
    record.actual_s = static_cast<double>(edge.actual_ns - edges.front().scheduled_ns) * 1e-9;
    record.exposure_start_s = record.actual_s;
    record.exposure_end_s = record.actual_s + exposure_s;
    records.push_back(record);
  }
  return records;
}

}  // namespace sole::capture
