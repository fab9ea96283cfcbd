#pragma once

#include <cstdint>
#include <vector>

namespace sole::sim {

/// The slide of one speckle projector: soft-edged random dots on a tile that repeats. Deterministic
/// for a seed.
class SpecklePattern {
 public:
  /// `dot_rad` is the mean dot diameter as an angle seen from the projector.
  SpecklePattern(std::uint64_t seed, double dot_rad);

  /// Light (0 to 1) in the direction with tangents x, y relative to the projector's axis.
  float At(double x, double y) const;

  /// What is left of the pattern in skin, where light travels sideways before it comes out again:
  /// most of it by a Gaussian of standard deviation `near_rad` (an angle seen from the projector),
  /// the share `far_share` over distances at which the dots are forgotten.
  SpecklePattern Scattered(double near_rad, double far_share) const;

 private:
  double texels_per_unit_;
  std::vector<std::uint8_t> texels_;
};

}  // namespace sole::sim
