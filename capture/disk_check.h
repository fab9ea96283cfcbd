#pragma once

#include <filesystem>

#include "core/rig_config.h"

namespace sole::capture {

/// Bytes a second that recording with this rig writes.
double WriteRateNeeded(const RigConfig& config);

/// Bytes that may still be written to the file system of `directory`, less disk.reserve_mb; infinite
/// if it cannot tell.
double RoomLeft(const std::filesystem::path& directory, const DiskConfig& disk);

/// What the disk takes, in bytes a second, written as this rig's recordings are for about a second.
/// Throws Error if it refuses.
double MeasureDisk(const std::filesystem::path& directory, const RigConfig& config);

/// Throws Error if `bytes` do not fit, or if the measured write rate times disk.max_share is below
/// what recording needs. Rates that any disk reaches (20 MB/s) are not measured.
void RequireDisk(const std::filesystem::path& directory, const RigConfig& config, double bytes);

}  // namespace sole::capture
