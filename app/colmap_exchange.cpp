#include "app/colmap_exchange.h"

#include <cmath>
#include <limits>
#include <map>

#include <fmt/format.h>

#include "calib/calibrate.h"
#include "core/error.h"
#include "io/colmap_model.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kFarOff_m = 0.25;

/// SERIAL of SERIAL/000001.png or SERIAL.png.
std::string SerialOf(const std::string& image) {
  const fs::path path(image);
  return path.has_parent_path() ? path.begin()->string() : path.stem().string();
}

Camera CameraOf(const io::ColmapModel& model, const io::ColmapImage& image, const CameraConfig& nominal, const std::string& where) {
  Camera camera = model.cameras[static_cast<std::size_t>(image.camera)];
  Require(camera.width == nominal.width && camera.height == nominal.height,
          fmt::format("{}: camera {} takes images of {}x{}, the rig file says {}x{}", where, nominal.serial, camera.width, camera.height,
                      nominal.width, nominal.height));
  camera.serial = nominal.serial;
  camera.cam_from_world = image.cam_from_world;
  const double off_m = (camera.CentreInWorld() - nominal.position_m).norm();
  Require(off_m <= kFarOff_m,
          fmt::format("{}: camera {} stands {:.2f} m from where the rig file has it; bring the model into the rig's world frame and "
                      "metres (colmap model_aligner or model_transformer), or mend position_m in the rig file", where, nominal.serial, off_m));
  return camera;
}

double RmsPx(const io::ColmapModel& model, const io::ColmapImage& image, int& points) {
  const Camera& camera = model.cameras[static_cast<std::size_t>(image.camera)];
  double squares = 0;
  for (const io::ColmapPixel& seen : image.pixels) {
    if (seen.point < 0) continue;
    const Eigen::Vector3d in_cam = image.cam_from_world * model.points[static_cast<std::size_t>(seen.point)].point_m;
    squares += (PixelFromPointInCam<double>(camera.intrinsics.data(), in_cam) - seen.pixel).squaredNorm();
    ++points;
  }
  return points > 0 ? std::sqrt(squares / (2 * points)) : kNaN;
}

}  // namespace

std::vector<std::string> ExportCalibrationToColmap(const fs::path& folder, const Rig& rig) {
  std::vector<io::ColmapView> views;
  std::vector<std::string> below;
  for (const Camera& camera : rig.cameras) {
    views.push_back({camera, camera.serial + ".png"});
    if (LooksThroughPlate(camera, rig.plate)) below.push_back(camera.serial);
  }
  io::WriteColmapModel(folder, io::ModelOfViews(views));
  return below;
}

ImportedCalibration ImportCalibrationFromColmap(const fs::path& folder, const RigConfig& config) {
  Validate(config);
  const io::ColmapModel model = io::ReadColmapModel(folder);
  std::map<std::string, const io::ColmapImage*> images;
  for (const CameraConfig& camera : config.cameras) images[camera.serial] = nullptr;
  ImportedCalibration result;
  for (const io::ColmapImage& image : model.images) {
    const auto found = images.find(SerialOf(image.name));
    if (found == images.end()) {
      result.ignored.push_back(image.name);
      continue;
    }
    Require(found->second == nullptr, folder.string() + ": camera " + found->first + " has several images, such as " +
                                          image.name + "; a rig has one pose, keep one image per camera");
    found->second = &image;
  }
  Calibration& calibration = result.calibration;
  CalibrationStats& stats = calibration.stats;
  double squares = 0;
  int all = 0;
  for (const CameraConfig& nominal : config.cameras) {
    const io::ColmapImage* image = images[nominal.serial];
    Require(image != nullptr, folder.string() + ": has no image of camera " + nominal.serial + "; name it " + nominal.serial +
                                  ".png or " + nominal.serial + "/000001.png");
    calibration.rig.cameras.push_back(CameraOf(model, *image, nominal, folder.string()));
    int points = 0;
    stats.camera_rms_px.push_back(RmsPx(model, *image, points));
    stats.camera_corners.push_back(points);
    if (points > 0) squares += 2 * points * std::pow(stats.camera_rms_px.back(), 2);
    all += points;
  }
  calibration.rig.plate = {config.plate.thickness_m, config.plate.index};
  calib::CompleteRig(config, calibration.rig);
  stats.reprojection_rms_px = all > 0 ? std::sqrt(squares / (2 * all)) : kNaN;
  stats.heldout_rms_air_mm = stats.heldout_rms_glass_mm = stats.heldout_rms_across_mm = stats.heldout_max_mm = kNaN;
  stats.ground_rms_mm = kNaN;
  calibration.created = calib::NowUtc();
  return result;
}

}  // namespace sole::app
