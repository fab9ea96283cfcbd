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

/// Writes a target into a folder: NAME.pdf, NAME.svg (several pages: NAME-1.svg and so on; the cube's body NAME.stl)
/// and NAME.json with true coordinates (docs/formats.md). `kind` is "cube" or "sheet" (the contact sheet), of the sizes in `rig`, or a
/// board as calib::ParseBoard reads it. Returns the files and what the print must measure. Throws Error for unknown kinds and
/// pages, and for sizes that do not fit.
nlohmann::json PrintTarget(const std::string& kind, const RigConfig& rig, const std::filesystem::path& folder,
                           const TargetPrintOptions& options = {});

}  // namespace sole::app
