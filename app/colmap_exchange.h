#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/rig.h"
#include "core/rig_config.h"

namespace sole::app {

/// Writes the cameras of a calibration as a COLMAP text model into FOLDER: one image SERIAL.png each, world
/// frame, metres, no points. Returns the serials of those below the glass, which COLMAP takes for cameras in
/// air. Throws Error if the folder cannot be written or a serial has white space.
std::vector<std::string> ExportCalibrationToColmap(const std::filesystem::path& folder, const Rig& rig);

struct ImportedCalibration {
  Calibration calibration;  ///< figures that nobody measured are NaN
  std::vector<std::string> ignored;  ///< images of no camera of the rig
};

/// Cameras of the rig from a COLMAP text model in the world frame and metres: the image SERIAL.png (any
/// ending) or the only one below SERIAL/ is that camera's. The plate is the rig file's. Where the model has
/// points, their residuals are the camera's. Throws Error if a camera of the rig has no image or several,
/// another image size, or stands more than 0.25 m from its nominal position (a model of its own frame or scale).
ImportedCalibration ImportCalibrationFromColmap(const std::filesystem::path& folder, const RigConfig& config);

}  // namespace sole::app
