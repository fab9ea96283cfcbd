#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/frame_set.h"
#include "core/mesh.h"
#include "core/rigid3.h"
#include "sim/plate_bending.h"

namespace sole::sim {

/// A skin-like body above the plate, world frame, metres.
struct SceneMesh {
  TriangleMesh mesh;
  /// Unit, one per vertex; computed from the mesh if empty.
  std::vector<Eigen::Vector3d> normals;
  /// Material coordinates, metres, one per vertex (the same point of skin in its rest position):
  /// the skin's texture hangs on them, so it moves with the skin. The vertices themselves if empty.
  std::vector<Eigen::Vector3d> material;
  /// Reflectance relative to skin, one per vertex (nails, a dark cut); all 1 if empty.
  std::vector<float> tone;
  /// Of every vertex, m/s, while the shutter is open; `mesh` stands at the middle of the exposure.
  /// At rest if empty.
  std::vector<Eigen::Vector3d> velocity;
};

/// A thin sheet printed with the same random dots on both sides, laid on the glass top: its lower
/// side is the plane that calibration looks for.
struct ContactSheet {
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();  ///< world x, y
  double turn_rad = 0;                                 ///< about z
  double size_x_m = 0.18, size_y_m = 0.36;  ///< leaves the default rig's fiducials uncovered
  double thickness_m = 0.0001;              ///< upper side's z; a sheet of paper
};

/// What stands in the rig during one exposure.
struct Scene {
  std::vector<SceneMesh> meshes;
  std::optional<Rigid3> world_from_target;  ///< the rig's calibration cube, if it is held in view
  std::optional<ContactSheet> sheet;        ///< alone on the plate, without meshes or cube
  ExposureKind exposure = ExposureKind::kSpeckle;
  bool fiducials = true;  ///< etched marks on the glass top
  bool dust = true;       ///< specks on the glass top
  PlateSag sag = {};      ///< of the glass; marks and dust go down with it
};

/// Poses world_from_target of the cube in the capture volume: tilted up to 35 degrees, turned all
/// round, centre at |x| < 0.08, |y| < 0.15, z 0.075 to 0.14, every corner at least 4 mm above the
/// glass. The same seed gives the same poses.
std::vector<Rigid3> CalibrationPoses(int count, double edge_m, std::uint64_t seed);

/// Contact sheets as hands lay them down: within 2 mm and 0.5 degrees of the middle. The same seed
/// gives the same places.
std::vector<ContactSheet> SheetPlaces(int count, std::uint64_t seed);

}  // namespace sole::sim
