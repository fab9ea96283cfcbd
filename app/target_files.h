#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

#include "core/rig_config.h"

namespace sole::app {

struct TargetPrintOptions {
  std::string page = "auto";        ///< calib::DrawBoard
  double paper_thickness_m = 1e-4;  ///< taken off the cube's body on every side
};

/// Writes a target into a folder: NAME.pdf, NAME.svg (the cube: NAME-1.svg to NAME-5.svg and the body NAME.stl)
/// and NAME.json with true coordinates (docs/formats.md). `kind` is "cube", of the sizes in `cube`, or a
/// board as calib::ParseBoard reads it. Returns the files and what the print must measure. Throws Error for unknown kinds and
/// pages, and for sizes that do not fit.
nlohmann::json PrintTarget(const std::string& kind, const TargetConfig& cube, const std::filesystem::path& folder,
                           const TargetPrintOptions& options = {});

}  // namespace sole::app
