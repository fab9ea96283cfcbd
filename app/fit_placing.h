#pragma once

#include <optional>
#include <span>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "app/stages.h"
#include "core/point_cloud.h"

namespace sole::app {

/// A scan turned so that the foot stands: z up.
struct Placing {
  Eigen::Matrix3d level_from_scan = Eigen::Matrix3d::Identity();
  double cost = 2;  ///< as FootStart: 0 (scan and resting foot cover each other) to 1.5; 2: nothing was found
};

/// Tries directions all round as up (or `up` alone) and lays the resting foot into the scan from each; the best
/// is refined to the direction that the foot found calls up. `hints` are directions to try besides.
Placing FindPlacing(const PointCloud& scan, const ModelPair& models, std::optional<Eigen::Vector3d> up,
                    std::span<const Eigen::Vector3d> hints);

/// The scan turned, without what lies higher than a foot is (the leg).
PointCloud TurnedFoot(const PointCloud& scan, const Eigen::Matrix3d& level_from_scan);

}  // namespace sole::app
