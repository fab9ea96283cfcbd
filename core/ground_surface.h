#pragma once

#include <string>
#include <vector>

#include <Eigen/Core>

namespace sole {

/// A nearly horizontal plane of the world: z = offset_m + slope_x x + slope_y y.
struct HeightPlane {
  double offset_m = 0;
  double slope_x = 0;
  double slope_y = 0;

  double At(const Eigen::Vector2d& place_m) const {
    return offset_m + slope_x * place_m.x() + slope_y * place_m.y();
  }
};

/// A fiducial of the plate as a take measured it.
struct GroundMark {
  int id = 0;
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();  ///< its centre, world frame
  double sigma_m = 0;                                 ///< standard deviation of its height
};

/// The glass top as a sheet laid on it showed it: height above the world's z = 0, which is the
/// plane that the fiducials gave the calibration. Plane plus a smooth residual, bilinear between
/// the nodes of a regular grid and constant beyond it. Default: z = 0.
struct GroundSurface {
  HeightPlane plane;
  Eigen::Vector2d first_node_m = Eigen::Vector2d::Zero();  ///< world x, y of node (0, 0)
  double spacing_m = 0;
  int nodes_x = 0, nodes_y = 0;    ///< 0: no residual; otherwise 2 or more
  std::vector<double> residual_m;  ///< node (i, j) at j * nodes_x + i
  std::vector<double> sigma_m;     ///< standard deviation of the height at each node
  std::vector<GroundMark> marks;   ///< fiducials beside the sheet in the same take
  double rms_m = 0;                ///< of the sheet's points from the surface
  int points = 0;
  double sheet_thickness_m = 0;  ///< that was taken off points of its upper side
  std::string created;           ///< ISO 8601, UTC
};

/// Height above the surface's plane.
double ResidualAt(const GroundSurface& surface, const Eigen::Vector2d& place_m);
/// Height of the glass top.
double HeightAt(const GroundSurface& surface, const Eigen::Vector2d& place_m);

/// Least-squares plane through marks, each weighted by its sigma. Throws Error for less than three.
HeightPlane PlaneThrough(const std::vector<GroundMark>& marks);

/// Where the marks beside the sheet lay: what uncovered glass of later takes is compared with. The
/// surface's own plane if it has fewer than three marks.
HeightPlane MarksPlane(const GroundSurface& surface);

}  // namespace sole
