#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/fault.h"
#include "core/target.h"

namespace sole {

/// One camera as the rig file describes it. Position and aim are nominal (they seed the calibration and
/// place the simulated camera); the true values are what calibration finds.
struct CameraConfig {
  std::string serial;
  std::string address;  ///< loopback address of the simulated device; empty for real cameras
  int width = 1624;
  int height = 1236;
  double focal_px = 3250;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d look_at_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  ///< world direction that appears upwards in the image
  double exposure_us = 4000;
  double gain_db = 0;
  int packet_size = 9000;
  int packet_delay_ns = 0;
};

struct PairConfig {
  std::string name;
  std::string left;
  std::string right;
};

struct TriggerConfig {
  std::string source = "simulated";  ///< simulated, gpio or software
  double rate_hz = 10;
  int warmup = 3;
  std::string gpio_chip = "gpiochip0";
  int gpio_line = 17;
  int bus_port = 17701;  ///< UDP port on 127.0.0.1 of the simulated trigger bus (core/trigger_bus.h)
};

struct PlateConfig {
  double size_x_m = 0.40;
  double size_y_m = 0.50;
  double thickness_m = 0.015;  ///< nominal; calibration estimates it
  double index = 1.52;         ///< from the data sheet; calibration keeps it
  std::vector<Fiducial> fiducials;
};

/// Dictionary of every marker in the rig: OpenCV's DICT_5X5_250. The cube takes ids from 0, fiducials bring
/// their own.
struct TargetConfig {
  double edge_m = 0.10;
  int squares = 5;
  double square_m = 0.018;
  double marker_m = 0.0135;
};

/// One speckle projector of the simulated rig.
struct ProjectorConfig {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d look_at_m = Eigen::Vector3d::Zero();
};

/// Only the simulator reads this section.
struct SimulationConfig {
  std::vector<ProjectorConfig> projectors;
  double noise = 1.0;  ///< scales photon and read noise; 0 is noise-free
  std::vector<FaultConfig> faults;
};

/// The rig file: one TOML for real and simulated rigs.
struct RigConfig {
  std::string name;
  std::vector<CameraConfig> cameras;
  std::vector<PairConfig> pairs;
  TriggerConfig trigger;
  PlateConfig plate;
  TargetConfig target;
  SimulationConfig simulation;
};

/// Hash of what a calibration depends on: serials, image sizes, pairs, plate index and fiducials. 16 hex
/// digits. A calibration of another rig is recognised by it.
std::string RigIdentityHash(const RigConfig& config);

/// Nominal pose from position_m, look_at_m and up. Throws Error if up is parallel to the view.
Rigid3 NominalCamFromWorld(const CameraConfig& camera);

/// Index of the camera with this serial. Throws Error if there is none.
int CameraIndex(const RigConfig& config, const std::string& serial);

/// Throws Error naming the first inconsistency: no camera, repeated serial, pair of unknown or equal
/// cameras, impossible sizes.
void Validate(const RigConfig& config);

/// The rig of `sole demo`: 4 cameras (one pair below the glass, one beside the foot), 8 or 20, at
/// width x height (focal lengths scale with the width; 1624 wide is 3250 px). Cameras sit on 127.0.0.11 onwards.
RigConfig MakeDefaultRig(int cameras = 4, int width = 1624, int height = 1236);

}  // namespace sole
