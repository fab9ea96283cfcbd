#pragma once

#include <map>
#include <span>
#include <string>

#include <Eigen/Core>

#include "core/fit_sequence.h"

namespace sole::sim {

/// Measures of a foot mesh of the reference connectivity in millimetres: footlength, balloffootlength,
/// footbreadthhorizontal, balloffootcircumference, heelbreadth, heelanklecircumference, bimalleolarbreadth,
/// lateralmalleolusheight, anklecircumference (columns of the survey), navicular_height, instep_height (at half the length),
/// arch_height and second_toe_lead (its tip ahead of the hallux's). Metatarsal heads, malleoli and navicular are landmarks, marked on the reference foot's skin, as the survey's measurers
/// marked them on people's. `vertices_m` has the ground at z = 0, toes towards +y.
std::map<std::string, double> MeasureFoot(std::span<const Eigen::Vector3d> vertices_m, Side side);

/// Height of the skin over the navicular's tuberosity, mm; of the unloaded foot it is the draw of the subjects' arches.
double NavicularHeight(std::span<const Eigen::Vector3d> vertices_m);

}  // namespace sole::sim
