#pragma once

#include <filesystem>

#include <nlohmann/json.hpp>

#include "calib/observations.h"
#include "core/rig.h"
#include "core/rig_config.h"

namespace sole::app {

/// Adds to `calibration` the glass top that a take of the contact sheet shows. Returns rms_mm, sigma_mm,
/// points, coverage, thickness_mm, shift_mm and tilt_mm against the fiducials, offset_mm of every pair. Throws Error if
/// the take belongs to another rig, does not show the sheet, or contradicts sheet thickness or fiducials.
nlohmann::json AddGround(Calibration& calibration, const std::filesystem::path& take);

/// Where the glass lies by the fiducials of a later take, against where it lay when the ground was measured: shift_mm
/// in the middle, tilt_mm over half the plate, fiducials. Null if the calibration has no ground, or the
/// take shows fewer than three fiducials.
nlohmann::json CompareGround(const Calibration& calibration, const RigConfig& config,
                             const calib::TakeObservations& observations);

}  // namespace sole::app
