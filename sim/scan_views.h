#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/mesh.h"
#include "core/rig_config.h"
#include "sim/true_rig.h"

namespace sole::sim {

/// How a rig's stereo pairs see a point of skin. Scans without images (scan_cloud.h) take noise and
/// gaps from it; noise is measured against the same (docs/accuracy.md).
struct ScanView {
  std::int16_t pair =
      -1;  ///< that sees it best (least incidence at the worse of its cameras); -1: none
  std::uint8_t pairs = 0;      ///< how many see it
  bool through_glass = false;  ///< the best pair looks up from below the plate
  float incidence_rad = 0;     ///< at the worse camera of the best pair
  /// Along the surface to the nearest point that a pair does not see, for the pair for which that
  /// is furthest: shadows, clefts, silhouettes and image borders are near where it is small. At
  /// most kMaxEdge_m.
  float edge_m = 0;
};

inline constexpr float kMaxEdge_m = 0.006f;
inline constexpr double kMaxScanIncidence_rad = 1.2217304763960306;  ///< 70 degrees

/// View of every vertex of a body above the plate, world frame. A pair sees a vertex that both its
/// cameras see (light path through the plate unobstructed, inside the image, below 70 degrees of
/// incidence) and a projector lights, as VisibleToPairs has it. Vertices with `dark` != 0 (the cut
/// above the ankle) show nothing; `dark` may be empty. Throws Error if `rig` has none of a pair's
/// cameras or `dark` another size.
std::vector<ScanView> FindScanViews(const RigConfig& config, const TrueRig& rig,
                                    const TriangleMesh& mesh,
                                    std::span<const std::uint8_t> dark = {});

}  // namespace sole::sim
