#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "core/rig.h"
#include "model/foot_model.h"

namespace sole::app {

/// Each stage reads what earlier stages left in the take and writes its own files; all are listed in
/// docs/formats.md. They throw Error where the input is missing or does not fit, and return a short account for the
/// terminal or --json.

/// Both sides of a foot model.
struct ModelPair {
  model::FootModel right;
  model::FootModel left;
};
/// Loads a model file and mirrors it.
ModelPair LoadModelPair(const std::filesystem::path& path);
/// The shipped model with contact: $SOLE_MODELS/sole-foot-contact.npz if that is set, else models/sole-foot-contact.npz
/// in a folder above the program's own, or share/sole/models there.
std::filesystem::path DefaultModelPath();
/// In the same place sole-foot.npz, without contact, from which `sole train` begins.
std::filesystem::path DefaultTemplatePath();

/// A file of the take's n-th foot (from 1), by that of the first: fit.npz, fit_2.npz ...
std::filesystem::path OfFoot(const std::filesystem::path& first, int foot);

/// What RunReconstruct makes of every cloud beside its file.
enum class ScanMesh { kNone, kTrimmed, kWatertight };

/// scans/, scans/platform/, scans/stats.json, scans/mesh/ if asked for and a copy of the calibration. Returns frames, points_mean,
/// frames_without_foot, seconds_per_frame. Meshes of an earlier run are removed: they belong to other clouds.
nlohmann::json RunReconstruct(const std::filesystem::path& take, const std::filesystem::path& calibration, ScanMesh mesh = ScanMesh::kNone);
/// contact.npz with the ground of every frame. Returns frames, plane_offset_mm (mean), platform_points (mean).
nlohmann::json RunContact(const std::filesystem::path& take);
/// fit.npz, fit.json, the labels of contact.npz and fit-sheet.png; fit_2.npz and contact_2.npz ... for further feet. Takes
/// of one subject that are fitted together share a shape; those of several are refused. Returns frames, found, good, side,
/// seconds_per_frame, with several feet `feet`, with several takes the accounts of each in `takes`.
nlohmann::json RunFit(const std::vector<std::filesystem::path>& takes, const ModelPair& models);
/// measurements.csv (measurements_2.csv ... for further feet). Returns the mean of every measure over the frames, in millimetres.
nlohmann::json RunMeasure(const std::filesystem::path& take, const ModelPair& models);

/// Formats of RunExport.
const std::vector<std::string>& ExportFormats();
/// Writes TAKE/exports/NAME.FORMAT (NAME_2.FORMAT ... for further feet) and returns the paths. Throws Error for an unknown
/// format, naming the known ones.
std::vector<std::filesystem::path> RunExport(const std::filesystem::path& take, const ModelPair& models, const std::string& format);

/// All of the above in order, leaving out what is newer than its input. `calibration` may be empty if the
/// take already holds one. Returns the accounts of the stages that ran and the exported files.
nlohmann::json RunProcess(const std::filesystem::path& take, const std::filesystem::path& calibration, const std::filesystem::path& model);

}  // namespace sole::app
