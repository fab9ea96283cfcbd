#include "core/rig_config.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <set>
#include <sstream>

#include "core/error.h"

namespace sole {

std::string RigIdentityHash(const RigConfig& config) {
  std::ostringstream text;
  text.precision(9);
  for (const CameraConfig& camera : config.cameras) {
    text << camera.serial << ' ' << camera.width << 'x' << camera.height;
    if (camera.offset_x != 0 || camera.offset_y != 0) text << '+' << camera.offset_x << '+' << camera.offset_y;
    text << '\n';
  }
  for (const PairConfig& pair : config.pairs) text << pair.left << '-' << pair.right << '\n';
  text << config.plate.index << '\n';
  for (const Fiducial& f : config.plate.fiducials) {
    text << f.id << ' ' << f.centre_m.x() << ' ' << f.centre_m.y() << ' ' << f.size_m << '\n';
  }
  std::uint64_t hash = 1469598103934665603ULL;  // FNV-1a
  for (const char c : text.str()) {
    hash ^= static_cast<unsigned char>(c);
    hash *= 1099511628211ULL;
  }
  char digits[17];
  std::snprintf(digits, sizeof digits, "%016llx", static_cast<unsigned long long>(hash));
  return digits;
}

double ShortestExposureInterval(const TriggerConfig& trigger) {
  const double period = 1 / trigger.rate_hz;
  const auto exposures = static_cast<double>(trigger.exposures.size());
  if (exposures < 2) return period;
  if (trigger.exposure_gap_s <= 0) return period / exposures;
  return std::min(trigger.exposure_gap_s, period - (exposures - 1) * trigger.exposure_gap_s);
}

namespace {

void ValidateTrigger(const TriggerConfig& trigger) {
  Require(trigger.rate_hz > 0 && trigger.rate_hz <= 1000, "trigger rate_hz must be above 0 and at most 1000");
  Require(trigger.source == "simulated" || trigger.source == "gpio" || trigger.source == "action" ||
              trigger.source == "software",
          "trigger source '" + trigger.source + "': use simulated, gpio, action or software");
  Require(!trigger.exposures.empty(), "trigger exposures: a cycle has at least one");
  Require(trigger.exposure_gap_s >= 0 && ShortestExposureInterval(trigger) > 0,
          "trigger exposure_gap_s: the exposures of a cycle do not fit into 1 / rate_hz");
  Require(trigger.pre_roll_s >= 0 && trigger.post_roll_s >= 0, "trigger pre_roll_s and post_roll_s must not be negative");
  Require(trigger.pulse_us > 0 && trigger.pulse_us * 1e-6 < ShortestExposureInterval(trigger),
          "trigger pulse_us must be above 0 and shorter than the time between exposures");
  for (const StrobeConfig& strobe : trigger.strobes) {
    Require(!strobe.line.empty(), "strobe '" + strobe.name + "' has no line");
  }
}

}  // namespace

int CameraIndex(const RigConfig& config, const std::string& serial) {
  for (std::size_t i = 0; i < config.cameras.size(); ++i) {
    if (config.cameras[i].serial == serial) return static_cast<int>(i);
  }
  throw Error("no camera with serial '" + serial + "' in rig '" + config.name + "'");
}

void Validate(const RigConfig& config) {
  Require(!config.cameras.empty(), "rig '" + config.name + "' has no cameras: add a [[camera]]");
  std::set<std::string> serials;
  for (const CameraConfig& camera : config.cameras) {
    const std::string where = "camera '" + camera.serial + "': ";
    Require(!camera.serial.empty(), "a camera has no serial");
    Require(serials.insert(camera.serial).second, where + "serial appears twice");
    Require(camera.width >= 64 && camera.width <= 16384 && camera.height >= 64 && camera.height <= 16384,
            where + "width and height must be 64 to 16384 pixels");
    Require(camera.offset_x >= 0 && camera.offset_y >= 0, where + "offset_x and offset_y must not be negative");
    Require(camera.focal_px > 0, where + "focal_px must be positive");
    Require(camera.exposure_us > 0, where + "exposure_us must be positive");
    Require(camera.aperture_m >= 0 && camera.aperture_m <= 0.1, where + "aperture_m must be 0 to 0.1 m");
    Require(camera.packet_size >= 576 && camera.packet_size <= 65500,
            where + "packet_size must be 576 to 65500 bytes");
    Require((camera.look_at_m - camera.position_m).norm() > 1e-3, where + "position_m equals look_at_m");
  }
  for (const PairConfig& pair : config.pairs) {
    Require(serials.contains(pair.left), "pair '" + pair.name + "': no camera '" + pair.left + "'");
    Require(serials.contains(pair.right), "pair '" + pair.name + "': no camera '" + pair.right + "'");
    Require(pair.left != pair.right, "pair '" + pair.name + "' names one camera twice");
  }
  ValidateTrigger(config.trigger);
  Require(config.disk.reserve_mb >= 0 && config.disk.write_test_mb >= 0 && config.disk.max_share > 0 &&
              config.disk.max_share <= 1,
          "disk reserve_mb and write_test_mb must not be negative, max_share above 0 and at most 1");
  Require(config.plate.thickness_m > 0 && config.plate.thickness_m < 0.1,
          "plate thickness_m must be above 0 and below 0.1 m");
  Require(config.plate.index >= 1 && config.plate.index < 3, "plate index must be 1 to 3");
  Require(config.simulation.ambient_light >= 0 && config.simulation.trigger_jitter_us >= 0,
          "simulation: ambient_light and trigger_jitter_us must not be negative");
  for (const FaultConfig& fault : config.simulation.faults) {
    MakeFault(fault.name, fault.camera, fault.amount, fault.unit, fault.trigger);
    Require(fault.camera.empty() || serials.contains(fault.camera),
            "fault " + fault.name + ": no camera '" + fault.camera + "'");
    Require(fault.name != "projector-off" || fault.amount <= static_cast<double>(config.simulation.projectors.size()),
            "fault projector-off: the rig has " + std::to_string(config.simulation.projectors.size()) + " projectors");
  }
  std::set<int> ids;
  for (const Fiducial& fiducial : config.plate.fiducials) {
    Require(ids.insert(fiducial.id).second, "fiducial id " + std::to_string(fiducial.id) + " appears twice");
    Require(fiducial.size_m > 0, "fiducial size_m must be positive");
  }
}

namespace {

struct PairPlacement {
  const char* name;
  Eigen::Vector3d centre;  ///< midway between the cameras
  Eigen::Vector3d look_at;
  double baseline_m;  ///< along the image's x axis
  Eigen::Vector3d up;
};

std::vector<PairPlacement> DefaultPlacements(int cameras) {
  using V = Eigen::Vector3d;
  const V up = V::UnitZ();
  // Below the glass the image's long side (x) lies along the foot (+y), so that one pair sees a whole sole.
  const V below_up = V::UnitX();
  std::vector<PairPlacement> placements{{"below", V(0, 0, -0.66), V(0, 0, 0), 0.12, below_up},
                                        {"dorsum", V(-0.38, 0.05, 0.52), V(0, 0, 0.035), 0.13, up}};
  if (cameras >= 8) {
    placements.push_back({"lateral", V(0.54, 0.02, 0.34), V(0, 0, 0.04), 0.13, up});
    placements.push_back({"toes", V(0, 0.60, 0.26), V(0, 0.03, 0.03), 0.13, up});
  }
  if (cameras == 20) {
    placements.push_back({"below front", V(0, 0.22, -0.58), V(0, 0.06, 0), 0.12, below_up});
    placements.push_back({"below back", V(0, -0.22, -0.58), V(0, -0.06, 0), 0.12, below_up});
    placements.push_back({"below side", V(-0.22, 0, -0.60), V(0, 0, 0.01), 0.12, below_up});
    placements.push_back({"heel", V(0, -0.60, 0.26), V(0, -0.03, 0.04), 0.13, up});
    placements.push_back({"medial", V(-0.62, 0, 0.16), V(0, 0, 0.04), 0.13, up});
    placements.push_back({"top", V(0.20, 0.06, 0.64), V(0, 0, 0.03), 0.13, up});
  }
  return placements;
}

}  // namespace

Rigid3 NominalCamFromWorld(const CameraConfig& camera) {
  const Eigen::Vector3d forward = (camera.look_at_m - camera.position_m).normalized();
  const Eigen::Vector3d right = forward.cross(camera.up);
  Require(right.norm() > 1e-6, "camera '" + camera.serial + "': up is parallel to the viewing direction");
  Eigen::Matrix3d world_from_cam;
  world_from_cam.col(0) = right.normalized();
  world_from_cam.col(1) = forward.cross(right).normalized();
  world_from_cam.col(2) = forward;
  return Rigid3{Eigen::Quaterniond(world_from_cam), camera.position_m}.Inverse();
}

RigConfig MakeDefaultRig(int cameras, int width, int height) {
  Require(cameras == 4 || cameras == 8 || cameras == 20,
          "the default rig has 4, 8 or 20 cameras, not " + std::to_string(cameras));
  RigConfig config;
  config.name = "simulated-" + std::to_string(cameras);
  for (const PairPlacement& placement : DefaultPlacements(cameras)) {
    CameraConfig camera;
    camera.width = width;
    camera.height = height;
    camera.focal_px = 3250.0 * width / 1624.0;
    camera.position_m = placement.centre;
    camera.look_at_m = placement.look_at;
    camera.up = placement.up;
    const Eigen::Vector3d image_x = NominalCamFromWorld(camera).Inverse().rotation * Eigen::Vector3d::UnitX();
    PairConfig pair{placement.name, "", ""};
    for (const double side : {-0.5, 0.5}) {
      const std::size_t index = config.cameras.size();
      char serial[16];
      std::snprintf(serial, sizeof serial, "SIM%04zu", index + 1);
      camera.serial = serial;
      camera.address = "127.0.0." + std::to_string(11 + index);
      camera.position_m = placement.centre + side * placement.baseline_m * image_x;
      config.cameras.push_back(camera);
      (side < 0 ? pair.left : pair.right) = camera.serial;
    }
    config.pairs.push_back(pair);
  }
  using V = Eigen::Vector3d;
  int id = 200;
  for (const double y : {-0.13, -0.07, 0.0, 0.07, 0.13}) {
    for (const double x : {-0.105, 0.105}) config.plate.fiducials.push_back({id++, {x, y}, 0.012});
  }
  config.simulation.projectors = {{V(0.20, 0.25, 0.60), V(0, 0, 0.03)},
                                  {V(-0.30, 0.05, 0.55), V(0, 0, 0.03)},
                                  {V(0.35, -0.20, 0.50), V(0, 0, 0.03)},
                                  {V(0.0, -0.45, 0.40), V(0, 0, 0.03)},
                                  {V(0.10, 0.10, -0.65), V(0, 0, 0.0)},
                                  {V(-0.10, -0.10, -0.65), V(0, 0, 0.0)}};
  return config;
}

}  // namespace sole
