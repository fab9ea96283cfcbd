#pragma once

#include <span>
#include <vector>

#include "app/stages.h"
#include "core/fit_sequence.h"
#include "core/ground_surface.h"
#include "core/point_cloud.h"

namespace sole::app {

/// Contact of one registered frame (contact/label.h): the scan it came from and the model, told no contact, have a say, too.
/// A frame without a foot has nothing but NaN gaps.
FrameContact LabelFrame(const ModelPair& models, const Eigen::VectorXd& beta, const FrameFit& frame, const PointCloud& scan,
                        const GroundPlane& ground, const GroundSurface& calibrated = {});

/// Contact of every frame of a fit, one cloud and one ground each. Throws Error where their numbers differ.
std::vector<FrameContact> LabelFit(const ModelPair& models, const FitSequence& fit, std::span<const PointCloud> clouds,
                                   std::span<const GroundPlane> ground, const GroundSurface& calibrated = {});

}  // namespace sole::app
