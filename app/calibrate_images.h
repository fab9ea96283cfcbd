#pragma once

#include <filesystem>
#include <string>

#include <nlohmann/json.hpp>

namespace sole::app {

/// Calibrates cameras from a folder of pictures (io/image_folder.h) of the board `target`
/// (calib::ParseBoard) and writes the calibration to `out`. `judge`, unless empty, is another board that some pictures show:
/// its lengths, as the calibrated cameras measure them, must be as given. Returns view_rms_px, camera_rms_px, pairs with
/// their stereo and epipolar errors, corners_dropped, judge. Throws Error if pictures of one camera differ in size, if the board
/// is not seen often enough or mirrored, if corners contradict each other or the boards' sizes do.
nlohmann::json CalibrateImages(const std::filesystem::path& folder, const std::string& target, const std::string& judge,
                               const std::filesystem::path& out);

}  // namespace sole::app
