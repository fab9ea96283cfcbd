#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "core/fault.h"
#include "core/frame_set.h"
#include "core/target.h"

namespace sole {

/// One camera as the rig file describes it. Position and aim are nominal (they seed the calibration and
/// place the simulated camera); the true values are what calibration finds.
struct CameraConfig {
  std::string serial;
  std::string role;     ///< what it looks at, in the lab's own words: "sole", "toes"; may be empty
  std::string address;  ///< network address; empty: wherever discovery finds the serial
  int width = 1624;     ///< region of interest on the sensor, pixels
  int height = 1236;
  int offset_x = 0;  ///< of the region's first pixel on the sensor
  int offset_y = 0;
  double focal_px = 3250;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d look_at_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();  ///< world direction that appears upwards in the image
  double aperture_m = 0.0014;  ///< diameter of the lens' entrance pupil; simulated defocus, 0 for none
  double exposure_us = 1000;
  double gain_db = 0;
  int packet_size = 9000;
  int packet_delay_ns = 0;
};

struct PairConfig {
  std::string name;
  std::string left;
  std::string right;
};

/// A light that is switched by an output line during the exposures of its kinds.
struct StrobeConfig {
  std::string name;
  std::string line;  ///< number or name on the trigger's gpio_chip
  std::vector<ExposureKind> exposures = {ExposureKind::kSpeckle};
};

/// A cycle of one or more exposures, repeated at rate_hz. GPIO lines are numbers ("17") or names.
struct TriggerConfig {
  std::string source = "simulated";  ///< simulated, gpio, action or software
  double rate_hz = 10;               ///< cycles per second
  std::vector<ExposureKind> exposures = {ExposureKind::kSpeckle};  ///< within a cycle, in order
  double exposure_gap_s = 0;  ///< between them; 0 spreads them evenly over the cycle
  int warmup = 3;
  double pre_roll_s = 0;   ///< kept from before the start by key or foot
  double post_roll_s = 0;  ///< recorded after the stop by key or foot
  std::string gpio_chip = "gpiochip0";
  std::string gpio_line = "17";
  std::string readback_line;  ///< input that is high while cameras expose; empty: none
  double pulse_us = 200;      ///< length of pulses on trigger and strobe lines
  std::vector<StrobeConfig> strobes;
  std::string action_address = "255.255.255.255";  ///< where action commands go
  std::uint32_t action_device_key = 1;
  std::uint32_t action_group_key = 1;
  std::uint32_t action_group_mask = 1;
  int bus_port = 17701;  ///< UDP port on 127.0.0.1 of the simulated trigger bus (core/trigger_bus.h)
};

/// Shortest time between two exposures of the schedule.
double ShortestExposureInterval(const TriggerConfig& trigger);

/// What recording demands of the disk.
struct DiskConfig {
  double reserve_mb = 64;    ///< free space that a take leaves untouched
  double max_share = 0.8;    ///< of the measured write rate that a take may need
  double write_test_mb = 256;  ///< size of the test before a take that needs much; 0: no test
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

/// The speckled sheet that is laid on the glass to find its top, printed alike on both sides.
struct SheetConfig {
  double size_x_m = 0.18;
  double size_y_m = 0.36;
  double thickness_m = 0.0001;  ///< cameras above see its upper side
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
  double ambient_light = 0.02;    ///< of the room on every surface, 1 = full white in 4 ms; 0 is off
  double trigger_jitter_us = 2;   ///< standard deviation of each camera's start of exposure
  bool plate_sag = true;  ///< the glass bends under the foot's load
  std::vector<FaultConfig> faults;
};

/// The rig file: one TOML for real and simulated rigs.
struct RigConfig {
  std::string name;
  std::vector<CameraConfig> cameras;
  std::vector<PairConfig> pairs;
  TriggerConfig trigger;
  DiskConfig disk;
  PlateConfig plate;
  TargetConfig target;
  SheetConfig sheet;
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
