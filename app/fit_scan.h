#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "app/stages.h"
#include "core/fit_sequence.h"
#include "core/rigid3.h"
#include "io/scan_file.h"
#include "model/measure.h"

namespace sole::app {

/// What is known of a foreign scan.
struct ScanFitOptions {
  std::optional<double> unit_m = {};       ///< of the file's numbers; absent: millimetres or metres by its size
  std::optional<Eigen::Vector3d> up = {};  ///< in the file's frame; absent: found
  bool floor = false;  ///< the scan stands on a floor, which may be seen around it: its points are no skin, heights
                       ///< count from it. Without: flat patches that fill a sole or close a cut leg are found and left out
};

/// A static scan fitted.
struct ScanFit {
  FitSequence fit;              ///< one frame, number 1; metres, axes and origin of the file
  Rigid3 level_from_scan;       ///< metres: to a frame with z up and the floor, or else the lowest point, at z = 0
  double unit_m = 1;            ///< of the file's numbers
  bool floor = false;           ///< a flat sole or floor was found, or asked for
  std::size_t points = 0;       ///< that the fit rests on
  std::size_t flat_points = 0;  ///< left out: filled sole, floor, cut leg
  std::vector<model::FootMeasure> measures;
};

/// Fits one foot to a scan by any scanner: any unit, rotation and origin, a leg of any length, the sole filled, seen or
/// missing. `name` begins the Error where this is no scan of a foot (too few points, wrong size, no floor though asked for).
ScanFit FitScan(const io::ScanFile& file, const std::string& name, const ModelPair& models,
                const ScanFitOptions& options = {});

/// Reads `scan`, writes NAME-fit.npz, NAME-fit.ply (fine registered surface, in the scan's own frame and unit) and
/// NAME-fit.glb (the same, standing, metres) to `out` (beside the scan if empty), and returns the account.
nlohmann::json RunFitScan(const std::filesystem::path& scan, const ModelPair& models, const ScanFitOptions& options,
                          const std::filesystem::path& out);

}  // namespace sole::app
