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
  /// Throws Error if the directory holds anything, is not writable, or if the disk is too full or
  /// too slow for `bytes` of this rig's images (RequireDisk); 0 = images are not stored.
  TakeFolder(const std::filesystem::path& directory, const RigConfig& config, double bytes);
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

/// Edges as lines of triggers.csv, numbered from 1, relative to the first scheduled one. Exposures
/// take `exposure_s`; with `echoes` they are what was read back, and an edge without an echo has an
/// exposure of no length.
std::vector<io::TriggerRecord> TriggerRecords(const std::vector<TriggerEdge>& edges,
                                              double exposure_s,
                                              const std::vector<ExposureEcho>* echoes = nullptr);

/// Findings on some images of the take (CheckImages), compared with the take `reference` if that is
/// not empty.
std::vector<TakeFinding> CheckTakeImages(const std::filesystem::path& directory,
                                         const RigConfig& config,
                                         const std::filesystem::path& reference);
/// Throws Error if the reference take cannot serve.
void RequireReference(const std::filesystem::path& directory, const RigConfig& config);

/// Findings on what the cameras delivered.
std::vector<TakeFinding> DeliveryFindings(const RecordResult& result, double usable_loss,
                                          double period_s);

/// Fills verdict and reasons of `result` from its counts and `findings`. `planned` triggers; 0: open
/// end.
void Judge(RecordResult& result, std::int64_t planned, double usable_loss, double period_s = 0.1,
           const std::vector<TakeFinding>& findings = {});

}  // namespace sole::capture
