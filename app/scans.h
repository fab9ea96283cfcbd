#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>

#include "sim/scan_noise.h"
#include "sim/subject.h"

namespace sole::app {

struct ScanDatasetOptions {
  int people = 10;
  int frames = 10;         ///< of each person
  int points = 30000;      ///< of a scan, at most; 0: as many as reconstruction would have
  std::uint64_t seed = 1;  ///< of the first person, as in MakePeople; the next ones follow
  sim::ScanNoise noise = sim::DefaultScanNoise();
  sim::Population population = sim::Population::kSurvey;
  const std::atomic<bool>* stop = nullptr;  ///< set to end early; what is finished stays
};

struct ScanDatasetResult {
  int people = 0;           ///< in the dataset now
  int made = 0;             ///< of them by this call
  std::int64_t scans = 0;   ///< made by this call
  std::int64_t points = 0;  ///< in them
  bool stopped = false;
};

/// Writes (or completes) a dataset of true meshes and clouds without images into `directory`
/// (docs/formats.md, scan datasets): dataset.json first, then a file per person, each renamed into
/// place when it is whole, people in parallel. Every person shows a motion on the plate and one in
/// the air, before a 20-camera rig of their own. A person's file depends on the seed and the
/// parameters only, not on threads or on who else is made. `done` hears how many people are there.
/// Throws Error if the directory holds a dataset of other parameters or more people, or something
/// else.
ScanDatasetResult MakeScanDataset(const std::filesystem::path& directory,
                                  const ScanDatasetOptions& options,
                                  const std::function<void(int)>& done = {});

/// "train", "validation" or "test" (8 : 1 : 1), by the person's number alone, so that no person is
/// in two of them, in whatever dataset.
const char* SplitOf(std::uint64_t person);

}  // namespace sole::app
