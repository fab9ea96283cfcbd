#pragma once

#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/point_cloud.h"
#include "model/foot_model.h"
#include "model/forward.h"

namespace sole::model {

/// A rigid placement of the resting foot in a scan.
struct FootStart {
  Side side = Side::kRight;
  ModelParameters parameters;  ///< rest pose but for root and translation
  double heading_rad = 0;      ///< of the toes from +y, counter-clockwise seen from above
  double cost = 0;             ///< 0 (scan and foot cover each other) to 1.5
};

struct FootStartOptions {
  std::size_t points = 300;   ///< of the scan, evenly thinned
  std::size_t keep = 3;       ///< placements returned for each side
  double kernel_m = 0.006;    ///< scale of the robust cost
  double radius_m = 0.05;     ///< points further from the foot do not pull
};

/// Tries headings all round and pitches from toes up to tiptoe, aligns the resting foot of shape `beta`
/// rigidly from each (iterative closest points, point to plane) and returns the best distinct ones,
/// best first. Scan points beyond the model's rim are the shank's and do not count. `side` and
/// `heading_rad` (within 60 degrees), where known, save the rest. Empty for a scan of fewer than 50
/// finite points. Needs no landmark and no level ground: the sole is the scan's lowest side in the
/// foot's own frame.
std::vector<FootStart> FindFootStarts(const FootModel& right, const FootModel& left,
                                      const PointCloud& scan, const Eigen::VectorXd& beta,
                                      std::optional<Side> side = {},
                                      std::optional<double> heading_rad = {},
                                      const FootStartOptions& options = {});

/// Heading of a posed foot, as in FootStart.
double HeadingOf(const ModelParameters& parameters);

/// Plane through the open rim of a foot's surface; `normal` points away from the foot, to the shank.
struct RimPlane {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  /// Less than 1 mm inside the rim, or outside. False without a rim.
  bool Beyond(const Eigen::Vector3d& p) const {
    return !normal.isZero() && (p - point).dot(normal) > -0.001;
  }
};
RimPlane RimPlaneOf(const TriangleMesh& surface, const std::vector<bool>& boundary);

}  // namespace sole::model
