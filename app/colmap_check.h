#pragma once

#include <atomic>

#include "calib/agreement.h"
#include "calib/calibrate.h"
#include "calib/colmap_rig.h"
#include "calib/observations.h"
#include "core/rig_config.h"

#include <nlohmann/json_fwd.hpp>

namespace sole::app {

struct ColmapRunOptions {
  calib::ColmapProblemOptions problem = {};
  double timeout_s = 600;  ///< of each of COLMAP's programs
  int threads = 0;         ///< cores it may use; 0: all
  const std::atomic<bool>* stop = nullptr;
};

/// Throws Error, one clear line, unless the program `colmap` is installed.
void RequireColmap();

/// Has COLMAP, run as a program in a temporary folder, find the cameras in air from nominal intrinsics
/// alone (calib/colmap_rig.h): mapper with the nominal intrinsics, then bundle_adjuster with free
/// intrinsics, then rig_bundle_adjuster, in which the cameras of each pose form the same rig. Throws
/// Error if a step fails or places less than half the images.
calib::ColmapRig FindRigWithColmap(const RigConfig& config, const calib::TakeObservations& observations,
                                   const ColmapRunOptions& options = {});

/// What COLMAP found and how far it agrees with a calibration.
struct ColmapCheck {
  calib::ColmapRig colmap;
  calib::Agreement agreement;
};
ColmapCheck CheckWithColmap(const RigConfig& config, const calib::TakeObservations& observations, const Rig& calibrated,
                            const ColmapRunOptions& options = {});

/// Calibration of a rig without cameras below the glass by COLMAP alone, judged on poses that COLMAP is not given.
Calibration CalibrateWithColmap(const RigConfig& config, const calib::TakeObservations& observations,
                                const calib::CalibrateOptions& options, const ColmapRunOptions& colmap_options = {});

/// One line a camera and a summary on stderr.
void LogCheck(const ColmapCheck& check);
nlohmann::json CheckJson(const ColmapCheck& check);

}  // namespace sole::app
