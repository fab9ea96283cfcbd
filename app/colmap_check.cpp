#include "app/colmap_check.h"

#include <stdlib.h>

#include <cctype>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/child_process.h"
#include "app/console.h"
#include "calib/colmap_calibration.h"
#include "core/error.h"
#include "io/atomic_file.h"
#include "io/colmap_database.h"
#include "io/colmap_model.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

/// Beyond these COLMAP went astray, such as by taking the target inside out, and there is nothing to compare.
constexpr double kMost_px = 1, kMostTarget_mm = 0.5;

/// Removed with all that is in it at the end.
class TemporaryFolder {
 public:
  TemporaryFolder() {
    std::string name = (fs::temp_directory_path() / "sole-colmap-XXXXXX").string();
    Require(::mkdtemp(name.data()) != nullptr, "cannot create a temporary folder " + name + ": set TMPDIR to one with room");
    path_ = name;
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  fs::path Make(const char* name) const {
    io::MakeDirectory(path_ / name);
    return path_ / name;
  }
  const fs::path& Path() const { return path_; }

 private:
  fs::path path_;
};

fs::path ColmapProgram() {
  const fs::path program = FindProgram("colmap");
  Require(!program.empty(), "the program colmap is not installed: run scripts/setup (Debian package colmap), or calibrate with "
                            "--method target");
  return program;
}

std::string LastLine(const fs::path& log) {
  std::string text = io::ReadFile(log);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  text = text.substr(text.rfind('\n') + 1);
  return text.substr(0, 200);
}

class Colmap {
 public:
  Colmap(const fs::path& folder, const ColmapRunOptions& options) : program_(ColmapProgram()), log_(folder / "log.txt") {
    // Its log files go to the temporary folder, too; Qt must not look for a screen.
    child_ = {.log = log_, .folder = folder, .timeout_s = options.timeout_s, .threads = options.threads, .stop = options.stop,
              .environment = {"QT_QPA_PLATFORM=offscreen", "TMPDIR=" + folder.string()}};
  }

  void operator()(std::vector<std::string> arguments) const {
    const int status = RunChild(program_, arguments, child_);
    Require(status == 0, fmt::format("colmap {} failed with status {}: {}", arguments.front(), status, LastLine(log_)));
  }

  io::ColmapModel Read(const fs::path& model, const fs::path& text) const {
    (*this)({"model_converter", "--input_path", model, "--output_path", text, "--output_type", "TXT"});
    return io::ReadColmapModel(text);
  }

 private:
  fs::path program_, log_;
  ChildOptions child_;
};

std::vector<std::string> MapperArguments(const fs::path& database, const fs::path& images, const fs::path& out, int threads) {
  // Matches are certain, since corners are coded, and few to an image. Until distortion is estimated the
  // nominal intrinsics miss by many pixels: wide tolerances, and nothing but poses and points is free.
  return {"mapper", "--database_path", database, "--image_path", images, "--output_path", out,
          "--Mapper.extract_colors", "0", "--Mapper.multiple_models", "0", "--Mapper.min_model_size", "4",
          "--Mapper.num_threads", std::to_string(threads > 0 ? threads : -1),
          "--Mapper.init_min_num_inliers", "22", "--Mapper.init_min_tri_angle", "30", "--Mapper.abs_pose_min_num_inliers", "10",
          "--Mapper.ba_refine_focal_length", "0", "--Mapper.ba_refine_extra_params", "0",
          "--Mapper.init_max_error", "8", "--Mapper.abs_pose_max_error", "24", "--Mapper.filter_max_reproj_error", "16",
          "--Mapper.tri_merge_max_reproj_error", "16", "--Mapper.tri_complete_max_reproj_error", "16"};
}

void WriteRigConfig(const fs::path& path, const io::ColmapModel& solved) {
  std::set<int> placed;
  for (const io::ColmapImage& image : solved.images) placed.insert(image.camera);
  json cameras = json::array();
  for (const int c : placed)
    cameras.push_back({{"camera_id", c + 1}, {"image_prefix", calib::ColmapImagePrefix(static_cast<std::size_t>(c))}});
  const json rig{{"ref_camera_id", calib::ReferenceCamera(solved) + 1}, {"cameras", cameras}};
  io::WriteStringAtomically(path, json::array({rig}).dump(2));
}

}  // namespace

void RequireColmap() { ColmapProgram(); }

calib::ColmapRig FindRigWithColmap(const RigConfig& config, const calib::TakeObservations& observations,
                                   const ColmapRunOptions& options) {
  const io::ColmapModel problem = calib::MakeColmapProblem(config, observations, options.problem);
  const TemporaryFolder folder;
  const Colmap colmap(folder.Path(), options);
  const fs::path database = folder.Path() / "database.db", sparse = folder.Make("sparse");
  io::WriteColmapDatabase(database, problem);
  colmap(MapperArguments(database, folder.Make("images"), sparse, options.threads));
  Require(fs::is_directory(sparse / "0"), "COLMAP could not begin: no two images show enough of the target from two sides; "
                                          "record more poses, or calibrate with --method target");
  const fs::path adjusted = folder.Make("adjusted"), filtered = folder.Make("filtered"), text = folder.Make("text"), rig = folder.Make("rig");
  const auto adjust = [&](const fs::path& from, const char* principal_point) {
    colmap({"bundle_adjuster", "--input_path", from, "--output_path", adjusted, "--BundleAdjustment.refine_principal_point", principal_point});
    return colmap.Read(adjusted, text);
  };
  adjust(sparse / "0", "0");  // few images of few cameras would diverge with everything free at once
  io::ColmapModel free = adjust(adjusted, "1");
  // COLMAP's adjustment is not robust: wrong corners are taken out, and it is run again.
  constexpr int kFilterRounds = 3;
  for (int round = 0; round < kFilterRounds; ++round) {
    const std::optional<double> limit_px = calib::OutlierLimitPx(free);
    if (!limit_px) break;
    colmap({"point_filtering", "--input_path", adjusted, "--output_path", filtered, "--max_reproj_error", std::to_string(*limit_px)});
    free = adjust(filtered, "1");
  }
  Require(2 * free.images.size() >= problem.images.size(),
          fmt::format("COLMAP placed {} of {} images only; record more poses, turned less from one to the next, or calibrate with "
                      "--method target", free.images.size(), problem.images.size()));
  Require(free.cameras.size() == problem.cameras.size(), "COLMAP lost a camera; calibrate with --method target");
  WriteRigConfig(folder.Path() / "rig.json", free);
  colmap({"rig_bundle_adjuster", "--input_path", adjusted, "--output_path", rig, "--rig_config_path", folder.Path() / "rig.json",
          "--BundleAdjustment.refine_principal_point", "1"});
  const calib::ColmapRig found = calib::ReadColmapRig(problem, colmap.Read(rig, folder.Make("rig-text")), config);
  Require(found.reprojection_rms_px < kMost_px && found.target_rms_mm < kMostTarget_mm,
          fmt::format("COLMAP's rig does not fit its own images ({:.2f} px, target {:.2f} mm off); record more poses, or calibrate with "
                      "--method target", found.reprojection_rms_px, found.target_rms_mm));
  return found;
}

ColmapCheck CheckWithColmap(const RigConfig& config, const calib::TakeObservations& observations, const Rig& calibrated,
                            const ColmapRunOptions& options) {
  ColmapCheck check{FindRigWithColmap(config, observations, options), {}};
  check.agreement = calib::CompareWithColmap(calibrated, check.colmap);
  return check;
}

Calibration CalibrateWithColmap(const RigConfig& config, const calib::TakeObservations& observations,
                                const calib::CalibrateOptions& options, const ColmapRunOptions& colmap_options) {
  const calib::DividedTake take = calib::DivideTake(config, observations, options);
  return calib::CalibrationFromColmap(config, FindRigWithColmap(config, take.adjust, colmap_options), take, options.limits);
}

void LogCheck(const ColmapCheck& check) {
  const auto& [colmap, agreement] = check;
  for (const calib::CameraAgreement& c : agreement.cameras) {
    Log(fmt::format("COLMAP: camera {}: centre {:.3f} mm, direction {:.4f} degrees, focal length {:+.2f} px, view {:.3f} px away{}",
                    c.serial, c.centre_mm, c.direction_deg, c.focal_px, c.view_px, c.agrees ? "" : ": DISAGREES"));
  }
  Log(fmt::format("COLMAP: {} cameras in air, {} of {} images, {:.4f} px; centres agree to {:.3f} mm RMS, directions to {:.4f} degrees, "
                  "views to {:.3f} px, scale {:+.4f} %",
                  agreement.cameras.size(), colmap.images_placed, colmap.images, colmap.reprojection_rms_px, agreement.centre_rms_mm,
                  agreement.direction_rms_deg, agreement.view_rms_px, 100 * (agreement.scale - 1)));
}

json CheckJson(const ColmapCheck& check) {
  const auto& [colmap, agreement] = check;
  json cameras = json::array(), disagree = json::array();
  for (std::size_t i = 0; i < agreement.cameras.size(); ++i) {
    const calib::CameraAgreement& c = agreement.cameras[i];
    cameras.push_back({{"serial", c.serial}, {"centre_mm", c.centre_mm}, {"direction_deg", c.direction_deg}, {"focal_px", c.focal_px},
                       {"view_px", c.view_px}, {"residual_px", colmap.camera_rms_px[i]}, {"points", colmap.camera_points[i]},
                       {"agrees", c.agrees}});
    if (!c.agrees) disagree.push_back(c.serial);
  }
  return {{"cameras", cameras}, {"disagree", disagree}, {"scale", agreement.scale}, {"centre_rms_mm", agreement.centre_rms_mm},
          {"direction_rms_deg", agreement.direction_rms_deg}, {"view_rms_px", agreement.view_rms_px},
          {"reprojection_rms_px", colmap.reprojection_rms_px}, {"target_rms_mm", colmap.target_rms_mm},
          {"fiducial_rms_mm", colmap.fiducial_rms_mm}, {"images", colmap.images}, {"images_placed", colmap.images_placed}};
}

}  // namespace sole::app
