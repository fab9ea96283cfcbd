#pragma once

#include <cstdint>
#include <filesystem>

#include "capture/recorder.h"
#include "io/take.h"

namespace sole::capture {

/// The directory of a take that is about to be recorded. Unless Keep is called, destruction takes
/// away what was made in it.
class TakeFolder {
 public:
  /// Throws Error if the directory holds anything, is not writable or has less room than `bytes`
  /// and a margin.
  TakeFolder(const std::filesystem::path& directory, double bytes);
  ~TakeFolder();
  TakeFolder(const TakeFolder&) = delete;
  TakeFolder& operator=(const TakeFolder&) = delete;

  void Keep() { keep_ = true; }
  const io::TakePaths& Paths() const { return paths_; }

 private:
  io::TakePaths paths_;
  bool created_ = false;
  bool keep_ = false;
};

/// Bytes that `triggers` frames of every camera take.
double BytesNeeded(const RigConfig& config, std::int64_t triggers);

/// Edges as lines of triggers.csv, relative to the first scheduled one.
std::vector<io::TriggerRecord> TriggerRecords(const std::vector<TriggerEdge>& edges,
                                              double exposure_s);

/// Fills verdict and reasons of `result` from its counts.
void Judge(RecordResult& result, std::int64_t planned, double usable_loss);

}  // namespace sole::capture
