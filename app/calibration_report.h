#pragma once

#include <filesystem>

#include "app/colmap_check.h"
#include "calib/observations.h"
#include "core/rig.h"

namespace sole::app {

/// One self-contained HTML page on a calibration: verdict, held-out errors in millimetres, cameras
/// with residuals, coverage and standard deviations, pairs, strong correlations, what to do next; with
/// `check`, how far COLMAP agrees; the ground surface if the calibration has one.
void WriteCalibrationReport(const std::filesystem::path& path, const Calibration& calibration,
                            const calib::TakeObservations& observations, const ColmapCheck* check = nullptr);

}  // namespace sole::app
