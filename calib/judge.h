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

/// Errors of distances between corners of the target.
struct TargetErrors {
  LengthErrors air;     ///< both ends seen by cameras above the plate
  LengthErrors glass;   ///< both ends seen by cameras below
  LengthErrors across;  ///< one end seen above, the other below
  int points = 0;       ///< seen by two or more cameras of one side, rejected ones included
};

/// Largest standard deviation of a triangulated corner that may judge, by the deviations that detection
/// states: metres, and times that of the median corner of its side of the plate where that is more.
/// Corners on grazing faces are measured to a tenth of a pixel, 0.1 mm in depth, and would judge
/// themselves instead of the calibration.
inline constexpr double kJudgeSigma_m = 2e-5;
inline constexpr double kJudgeSigmas = 1.5;

/// Triangulates the target's corners in every frame of `heldout` from the cameras above the plate and
/// again from those below (two or more per corner, unless it is too uncertain: kJudgeSigma_m) and
/// compares all distances between corners of one frame with the known body. A corner whose
/// reprojection misses by more than `reject_px` is a wrong detection and left out.
TargetErrors JudgeTarget(const Rig& rig, const TakeObservations& heldout,
                         const std::vector<Eigen::Vector3d>& target_corners,
                         double reject_px = 1.0);

/// What each stereo pair alone makes of the held-out poses, in the rig's order.
struct PairErrors {
  /// Displacement (median over the corners, RMS over the poses) of the body as the pair sees it from
  /// where all cameras see it. Corner noise averages out, so that a wrong plate shows: pairs that
  /// look through it obliquely put things elsewhere. NaN where a pair sees no pose.
  double offset_mm = 0;
  /// RMS distance of a corner from the other image's epipolar curve.
  double epipolar_px = 0;
};
std::vector<PairErrors> JudgePairs(const Rig& rig, const TakeObservations& heldout,
                                   const std::vector<Eigen::Vector3d>& target_corners,
                                   double reject_px = 1.0);

/// Distance of triangulated fiducials from the glass top z = 0: RMS in `rms_mm`. A fiducial is the
/// mean of its corners (mean pixels over the take, all cameras that see them, two or more).
LengthErrors JudgeGround(const Rig& rig, const TakeObservations& take, double reject_px = 1.0);

/// Point nearest to all rays in the least-squares sense. Not finite for fewer than two or parallel
/// rays.
Eigen::Vector3d NearestPoint(std::span<const Ray> rays);

}  // namespace sole::calib
