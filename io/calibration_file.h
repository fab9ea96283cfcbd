#pragma once

#include <filesystem>

#include "core/rig.h"

namespace sole::io {

/// Calibration result as JSON (docs/formats.md). Reading checks version, sizes and finite numbers;
/// throws Error with the path.
void WriteCalibration(const std::filesystem::path& path, const Calibration& calibration);
Calibration ReadCalibration(const std::filesystem::path& path);

}  // namespace sole::io
