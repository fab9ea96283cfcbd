#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "sim/plate_bending.h"
#include "sim/posing.h"

namespace sole::sim {

struct ContactOptions {
  double load_n = 0;  ///< 0 or less: no contact is sought, the pose stands as given
  /// Centre of pressure along the foot, 0 = heel, 1 = toe tip; absent: tilt stays as posed and only the height is solved.
  std::optional<double> pressure_centre_y = {};
  std::optional<double> pressure_centre_x_m = {};  ///< to the right of the foot's heading, world; absent: no roll is solved
  std::optional<PlateModel> plate = {};            ///< bends under the foot; absent: the plate is rigid
};

/// A foot on the plate, whose unloaded top is z = 0, world frame. Vectors have one value per vertex.
struct LoadedFoot {
  PosedFoot foot;
  std::vector<std::uint8_t> contact;  ///< gap to the (sagged) plate below 0.1 mm
  std::vector<double> penetration_m;  ///< shortening of the elastic column above the vertex
  std::vector<double> pressure_pa;
  std::vector<double> load_n;         ///< share of the load; sums to total_load_n
  double total_load_n = 0;
  Eigen::Vector2d pressure_centre_m = Eigen::Vector2d::Zero();  ///< world x, y
  double contact_area_m2 = 0;
  PlateSag sag;           ///< of the glass under the foot's load; without nodes where it is rigid or unloaded
  bool balanced = false;  ///< load and centre of pressure reached within 1 %
};

/// Presses a posed foot on the plate: elastic columns over the bones carry the load, height and tilt
/// are solved for balance, the skin is laid on the plate, leaves it with a smooth profile and bulges sideways. A plate that bends is
/// solved with the foot until both agree to a micrometre.
LoadedFoot PressOnPlate(const Subject& subject, const FootPose& pose, const ContactOptions& options);

/// Lowers the arch as a load does; `share` of the body weight, 0 to 1.2.
void LowerArch(double share, FootPose& pose);

/// Heel and ball find the ground under the load as `options` say, then the toes reach for it until their pulps would be
/// `sink_m` below it.
void ReachForGround(const Subject& subject, const ContactOptions& options, double sink_m, FootPose& pose);

/// A standing person's pose under a load (newtons): the arch lowered, the toes on the ground.
FootPose LoadedStandingPose(const Subject& subject, double load_n, double pressure_centre_y = 0.42);

/// Quiet standing: LoadedStandingPose pressed on the plate.
LoadedFoot StandOnPlate(const Subject& subject, double load_n, double pressure_centre_y = 0.42);

}  // namespace sole::sim
