#pragma once

#include <Eigen/Core>
#include <vector>

#include "calib/adjust.h"
#include "calib/observations.h"
#include "core/rig_config.h"

namespace sole::calib {

/// Start values of the adjustment from the images: nominal intrinsics (focal length of the rig
/// file, principal point in the middle, no distortion), camera poses from the fiducials or, for a
/// camera that sees fewer than two, through target poses shared with cameras already placed; target
/// poses from the cameras. Nominal camera positions of the rig file are not used. Frames in which
/// no camera sees the target keep the identity. `target_corners` and `fiducial_corners` as from
/// TargetCorners and FiducialCornerPoints. Throws Error if no camera sees two fiducials, or naming
/// a camera that cannot be placed.
AdjustState StartValues(const RigConfig& config, const TakeObservations& observations,
                        const std::vector<Eigen::Vector3d>& target_corners,
                        const std::vector<Eigen::Vector3d>& fiducial_corners);

/// Poses of the target in every frame, from cameras that are all placed already.
void PlaceTargets(AdjustState& state, const TakeObservations& observations,
                  const std::vector<Eigen::Vector3d>& target_corners);

/// The same where only some cameras are `placed`; the others are placed through target poses that
/// they share. Returns which ones are placed then.
std::vector<bool> PlaceAll(AdjustState& state, const TakeObservations& observations,
                           const std::vector<Eigen::Vector3d>& target_corners,
                           const std::vector<bool>& placed);

/// Sum over all cameras of min(1, (residual / 20 px)^2) of one frame's target corners, for a target
/// pose. Lower is better; the number of observations is the worst.
double PoseCost(const AdjustState& state, const std::vector<ViewObservations>& frame,
                const std::vector<Eigen::Vector3d>& target_corners, const Rigid3& world_from_body,
                const std::vector<bool>& use_camera);

}  // namespace sole::calib
