#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "calib/observations.h"
#include "core/rig.h"

namespace sole::calib {

/// Errors of triangulated lengths, millimetres.
struct LengthErrors {
  double rms_mm = 0;
  double max_mm = 0;
  int lengths = 0;   ///< 0: nothing could be judged
  int rejected = 0;  ///< points whose rays miss each other
};

/// Which cameras triangulate.
enum class ViewSide { kAir, kGlass };

/// Triangulates the target's corners in every frame of `heldout` from cameras of one side only (two
/// or more per corner) and compares all distances between corners of one frame with the known body.
/// A corner whose reprojection misses by more than `reject_px` is a wrong detection and left out.
LengthErrors JudgeTarget(const Rig& rig, ViewSide side, const TakeObservations& heldout,
                         const std::vector<Eigen::Vector3d>& target_corners,
                         double reject_px = 1.0);

/// Distance of triangulated fiducials from the glass top z = 0: RMS in `rms_mm`. A fiducial is the
/// mean of its corners (mean pixels over the take, all cameras that see them, two or more).
LengthErrors JudgeGround(const Rig& rig, const TakeObservations& take, double reject_px = 1.0);

/// Point nearest to all rays in the least-squares sense. Not finite for fewer than two or parallel
/// rays.
Eigen::Vector3d NearestPoint(std::span<const Ray> rays);

}  // namespace sole::calib
