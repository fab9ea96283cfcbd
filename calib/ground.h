#pragma once

#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "calib/observations.h"
#include "core/ground_surface.h"
#include "core/rig.h"
#include "core/rig_config.h"

namespace sole::calib {

/// A matched and triangulated point of the contact sheet, world frame.
struct SheetPoint {
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  double sigma_m = 0;  ///< standard deviation of its height
  int pair = 0;        ///< that saw it, index into Rig::pairs
  bool from_below = false;  ///< through the glass: the sheet's lower side, otherwise its upper
};

struct GroundOptions {
  double max_distance_m = 0.0005;  ///< of the sheet's points from their plane
  double cell_m = 0.005;           ///< by whose number of points the sheet is told from dust
  double node_m = 0.02;            ///< of the residual's grid
  double bend_sigma_m = 5e-6;      ///< change of slope from node to node, as height
  double outlier_sigmas = 4;       ///< robust standard deviations
  double floor_m = 1e-5;           ///< error of a point that its sigma does not know
  double common_points = 4;        ///< whose windows overlap, so that they count as one
  double pair_sigma_m = 1e-5;      ///< error of one pair's heights where there is no other to tell
  int min_points = 1000;           ///< of the sheet
  double max_thickness_mm = 0.03;  ///< of the sheet's thickness from the given one
  double max_shift_mm = 0.05;      ///< of the sheet from the fiducials' plane
  double min_coverage = 0.5;       ///< of the sheet's area
};

/// What one pair alone says.
struct SheetView {
  int pair = 0;
  int points = 0;
  double offset_mm = 0;  ///< mean height of its points above the surface
};

struct GroundEstimate {
  GroundSurface surface;
  std::vector<SheetView> views;
  int rejected = 0;      ///< points on the sheet too far from the surface
  double coverage = 0;   ///< seen share of the sheet's area
  double sigma_mm = 0;   ///< median of the nodes' standard deviations
  /// Distance between the sheet's sides where both were seen; NaN if one was not.
  double thickness_mm = std::numeric_limits<double>::quiet_NaN();
  /// Height of the sheet above the plane through the fiducials, in the middle of what was seen, and
  /// the largest change of that height within it; NaN for fewer than three fiducials.
  double shift_mm = std::numeric_limits<double>::quiet_NaN();
  double tilt_mm = std::numeric_limits<double>::quiet_NaN();
  std::vector<std::string> failures;  ///< why the surface must not be used; empty: it may
};

/// Glass top from points of the sheet laid on it: points seen from above are lowered by the sheet's
/// thickness, points outside the sheet (dust, fiducials) and outliers set aside, then a plane and a
/// smooth residual fitted by robust least squares. The standard deviations hold how far pairs
/// disagree, which the number of points does not average away. `marks` are the plate's fiducials in
/// the same take (MeasureMarks). Throws Error if there are too few points.
GroundEstimate EstimateGround(const std::vector<SheetPoint>& points, const RigConfig& config,
                              const std::vector<GroundMark>& marks,
                              const GroundOptions& options = {});

/// Fiducials of a take, triangulated from all cameras that see them (mean pixels over the take, two
/// or more cameras); a corner whose rays miss its pixels by more than `reject_px` is left out.
std::vector<GroundMark> MeasureMarks(const Rig& rig, const RigConfig& config,
                                     const TakeObservations& take, double reject_px = 1.0);

/// How the glass lies in a later take: the plane through its fiducials less the one through those
/// beside the sheet, so the surface is higher by this. Throws Error for fewer than three marks.
HeightPlane GroundShift(const GroundSurface& surface, const std::vector<GroundMark>& marks);

}  // namespace sole::calib
