#pragma once

#include <atomic>
#include <cstdint>
#include <optional>

#include "core/rig_config.h"
#include "io/npz.h"
#include "sim/scan_noise.h"
#include "sim/subject.h"

namespace sole::app {

/// The scans of one person as the arrays of a person's file (docs/formats.md, scan datasets).
struct PersonScans {
  io::Npz arrays;
  std::int64_t points = 0;
};

struct PersonScansOptions {
  int frames = 10;
  int points = 30000;  ///< of a scan, at most; 0: all
  sim::Population population = sim::Population::kSurvey;
  const std::atomic<bool>* stop = nullptr;
};

/// Draws person `seed`, moves the foot, looks at it with a rig drawn for the person and makes the
/// clouds. Empty if `stop` was set meanwhile.
std::optional<PersonScans> MakePersonScans(std::uint64_t seed, const RigConfig& config,
                                           const sim::ScanNoise& noise,
                                           const PersonScansOptions& asked = {});

}  // namespace sole::app
