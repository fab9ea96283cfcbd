#pragma once

#include <cstdint>
#include <vector>

#include "core/rig_config.h"
#include "sim/renderer.h"

namespace sole::sim {

struct VisibilityOptions {
  double max_incidence_rad = 1.2217304763960306;  ///< 70 degrees, at each camera
};

/// Which vertices of a mesh of the scene a stereo pair can measure: seen by both cameras (inside
/// both images, light path through the plate unobstructed by any body, incidence below the limit)
/// and lit by at least one projector. The scene must be prepared for a speckle exposure. Result:
/// one vector per pair, one 0 or 1 per vertex. Throws Error for an unknown mesh, camera or
/// exposure.
std::vector<std::vector<std::uint8_t>> VisibleToPairs(const Renderer& renderer,
                                                      const PreparedScene& scene, int mesh,
                                                      const std::vector<PairConfig>& pairs,
                                                      const VisibilityOptions& options = {});

}  // namespace sole::sim
