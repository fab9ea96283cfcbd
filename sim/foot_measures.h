#pragma once

#include <map>
#include <span>
#include <string>

#include <Eigen/Core>

#include "core/fit_sequence.h"

namespace sole::sim {

/// Measures of a foot mesh of the reference connectivity in millimetres: footlength, balloffootlength,
/// footbreadthhorizontal, balloffootcircumference, heelbreadth, heelanklecircumference, bimalleolarbreadth,
/// lateralmalleolusheight, anklecircumference (columns of the survey), instep_height (at half the length) and arch_height. `vertices_m` has
/// the ground at z = 0, toes towards +y.
std::map<std::string, double> MeasureFoot(std::span<const Eigen::Vector3d> vertices_m, Side side);

}  // namespace sole::sim
