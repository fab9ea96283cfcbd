#pragma once

#include <vector>

#include <Eigen/Core>

#include "core/fit_sequence.h"
#include "core/ground_surface.h"
#include "core/point_cloud.h"

namespace sole::contact {

/// A vertex touches the glass when its gap is below this (SUPR-Foot, section on contact).
inline constexpr double kContactGap_m = 0.0001;

/// What is known of a foot's skin in one frame, world frame.
struct SkinEvidence {
  const Eigen::MatrixX3d& registered_m;   ///< N x 3, vertices of the registration
  const Eigen::VectorXd& registered_sd_m; ///< N, along the normal; large where the scan has no points
  const Eigen::MatrixX3d& undeformed_m;   ///< N x 3, of the fitted model told no contact: reaches below the glass where it presses
  const PointCloud& scan;                 ///< that was registered
};

struct LabelOptions {
  double tangential_sd_m = 0.001;  ///< how far along the skin a registered vertex may lie from its place
  double patch_sd_m = 0.0015;      ///< weight of scan points in the skin's height at a vertex
  double reach_m = 0.005;          ///< scan points further from a vertex say nothing
  double near_m = 0.004;           ///< of skin further from the glass its registered vertex alone is asked
  /// Log odds of contact: a constant, then what each of three figures adds, see LabelContact. Fitted by logistic regression to
  /// simulated people (docs/accuracy.md).
  double odds = -1.13, odds_share = 0.464, odds_gap = -0.745, odds_depth_per_m = -2298;
};

/// What one vertex has to say, see LabelContact; zero is what says nothing.
struct VertexEvidence {
  double share = 0;    ///< log odds of the scan around it that touches
  double gap = 0;      ///< asinh((gap - 0.1 mm) / 0.1 mm)
  double depth_m = 0;  ///< height of the undeformed vertex over the glass, -4 to 2 mm
  double sd_m = 0;     ///< of registered vertex and ground together
  double gap_m = 0;    ///< of the skin; NaN for a vertex that is no number
};
std::vector<VertexEvidence> GatherEvidence(const SkinEvidence& skin, const GroundPlane& ground, const GroundSurface& calibrated = {},
                                           const LabelOptions& options = {});

/// Contact of every vertex. A registered vertex lies about a millimetre beside its place on the skin, so its own height says
/// little near the border of the contact. Three figures are asked, and the probability is the logistic of their sum:
///  * share: how much of the scan around the vertex, as far as it may be displaced, lies on the glass (as log odds);
///  * gap: height of the skin at the vertex over the local glass, from the scan points around (as asinh((gap - 0.1 mm) / 0.1 mm));
///  * depth: height of the undeformed model's vertex, which pressing has pushed up to the glass.
/// Without scan points around it, depth alone speaks; deviations of vertex and ground draw the probability to one half. bit =
/// probability above one half; `gap_m` is the gap above. The residual of the `calibrated` surface counts, too. Rows that are NaN get bit 0,
/// probability 0 and a NaN gap. Throws Error where the sizes differ.
FrameContact LabelContact(const SkinEvidence& skin, const GroundPlane& ground, const GroundSurface& calibrated = {},
                          const LabelOptions& options = {});

}  // namespace sole::contact
