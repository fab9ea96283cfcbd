#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/frame_set.h"
#include "core/mesh.h"
#include "core/rigid3.h"

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
};

/// What stands in the rig during one exposure.
struct Scene {
  std::vector<SceneMesh> meshes;
  std::optional<Rigid3> world_from_target;  ///< the rig's calibration cube, if it is held in view
  ExposureKind exposure = ExposureKind::kSpeckle;
  bool fiducials = true;  ///< etched marks on the glass top
  bool dust = true;       ///< specks on the glass top
};

/// Poses world_from_target of the cube in the capture volume: tilted up to 35 degrees, turned all
/// round, centre at |x| < 0.08, |y| < 0.15, z 0.075 to 0.14, every corner at least 4 mm above the
/// glass. The same seed gives the same poses.
std::vector<Rigid3> CalibrationPoses(int count, double edge_m, std::uint64_t seed);

}  // namespace sole::sim
