#pragma once

#include <cstddef>

namespace sole {

/// A Projector in plain numbers; the rotation row by row.
struct ProjectorValues {
  double rotation[9], translation[3], centre[3], intrinsics[9];
  double thickness_m, index;
};

inline constexpr std::size_t kProjectedAtOnce = 8;

/// Pixels of kProjectedAtOnce points (x, y, z one after the other) with one step of the solver for
/// the plate. Returns the largest step: above kOneStepSuffices, or not a number, they are not exact.
double ProjectWithOneStep(const ProjectorValues& projector, const double* points, double* pixels);

/// A Householder step of the lateral scale below this leaves less than 1e-11.
inline constexpr double kOneStepSuffices = 0.012;

}  // namespace sole
