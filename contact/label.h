#pragma once

#include "core/fit_sequence.h"
#include "core/ground_surface.h"

namespace sole::contact {

/// A vertex touches the glass when its gap is below this (SUPR-Foot, section on contact).
inline constexpr double kContactGap_m = 0.0001;

/// Contact of every vertex of a registration (N x 3, world frame). `vertex_sd_m` (N) is each vertex's
/// standard deviation; the ground's own is added. bit = gap < 0.1 mm (negative gaps too); probability =
/// P(true gap < 0.1 mm) under a normal error. The residual of the `calibrated` surface counts, too. Rows that are NaN get bit 0, probability 0 and a NaN gap.
FrameContact LabelContact(const Eigen::MatrixX3d& vertices_m, const Eigen::VectorXd& vertex_sd_m,
                          const GroundPlane& ground, const GroundSurface& calibrated = {});

}  // namespace sole::contact
