#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/ground_surface.h"
#include "io/take.h"

// What several stages read of a take (stages.cpp).

namespace sole::app {

std::vector<std::int64_t> TriggerNumbers(const io::TakePaths& take);

/// The glass top as calibration saw it, by the calibration that the scans were made with; z = 0 without.
GroundSurface CalibratedGround(const io::TakePaths& take);

/// Files of feet, from the n-th on, that an earlier run found.
void RemoveFrom(int foot, const std::filesystem::path& first);

}  // namespace sole::app
