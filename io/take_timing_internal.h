#pragma once

#include <vector>

#include "io/raw_file.h"
#include "io/take.h"

namespace sole::io {

/// Adds to `triggers` every trigger from 1 to `last` that it lacks: schedule and kind from the
/// cycle before and the rig, kind from the records where they tell it, actual time from the
/// cameras' clocks, which are tied to the host's by the triggers that are known.
void CompleteTriggers(std::vector<TriggerRecord>& triggers, std::int64_t last,
                      const RigConfig& config, const std::vector<std::vector<RawRecord>>& cameras);

}  // namespace sole::io
