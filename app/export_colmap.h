#pragma once

#include <filesystem>

namespace sole::app {

/// Writes TAKE/exports/colmap/000001 and so on, a dense COLMAP workspace for every scan of a reconstructed
/// take (docs/formats.md), and returns TAKE/exports/colmap. Throws Error without scans or calibration.
std::filesystem::path ExportColmap(const std::filesystem::path& take);

}  // namespace sole::app
