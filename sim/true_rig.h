#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/rig_config.h"
#include "core/rigid3.h"

namespace sole::sim {

/// Exposure that the rig's lamps are made for: their flash of this length gives a gain of 1.
inline constexpr double kLampExposure_us = 1000;
/// Exposure in which room light of 1 makes a white surface full white: it burns all the time, so a
/// shorter exposure takes less of it.
inline constexpr double kRoomLightExposure_us = 4000;

/// One simulated camera as it really is. Lens: Brown-Conrady on normalised coordinates in OpenCV's
/// order, pixel (0, 0) is the centre of the first pixel; looks along +z, x right, y down.
struct TrueCamera {
  std::string serial;
  int width = 0;
  int height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< px
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0;
  Rigid3 cam_from_world;
  double gain = 1;  ///< grey levels relative to the nominal camera (exposure and analogue gain)
  double analogue_gain = 1;   ///< the part of it that amplifies noise like light
  double exposure_s = 1e-6 * kLampExposure_us;  ///< how long the shutter is open
  double vignetting = 0;  ///< relative loss of light at the image corner
  double blur_px = 0.6;   ///< standard deviation of the lens' Gaussian blur in focus
  double aperture_m = 0;  ///< diameter of the entrance pupil; 0: everything is in focus
  double focus_m = 0.6;   ///< distance of sharpest focus along the axis
  double fog = 0;         ///< share of the light that a fogged lens scatters; a fault
  double hot_pixels = 0;  ///< share of the pixels stuck at full level; a fault

  Eigen::Vector3d Centre() const { return cam_from_world.Inverse().translation; }
};

/// The glass: -thickness_m <= z <= 0, |x| <= size_x_m / 2, |y| <= size_y_m / 2.
struct TruePlate {
  double size_x_m = 0.4;
  double size_y_m = 0.5;
  double thickness_m = 0.015;
  double index = 1.52;
};

/// What nobody but the simulator and its judges know. World frame: z = 0 is the glass top, z up.
struct TrueRig {
  std::vector<TrueCamera> cameras;
  TruePlate plate;
};

/// Draws a true rig near the nominal one: positions +-3 mm, directions about 0.3 deg, focal length
/// +-1 %, principal point +-15 px (at 1624 px width), barrel distortion, gain, vignetting, blur,
/// plate thickness +-0.3 mm, index +-0.005. The same seed gives the same rig. Throws Error for an
/// inconsistent `config`.
TrueRig DrawTrueRig(const RigConfig& config, std::uint64_t seed);

/// Writes truth/rig.json (docs/formats.md), atomically, making its directory.
void WriteTruthRig(const std::filesystem::path& path, const TrueRig& rig);

}  // namespace sole::sim
