#pragma once

#include <memory>

#include "sim/foot_shape.h"
#include "sim/subject.h"

namespace sole::sim {

/// Solves the shape of a foot whose subject has everything but it, so that it has subject.measures_mm: the survey's nine standing at half
/// the body weight, navicular_height at rest. `habit` has the handles that are not solved. What no foot of this anatomy can have
/// at once (a heel-ankle girth too small for the ankle's height, say) is met as well as the handles' ranges allow, each measure weighed
/// by its spread among people, the navicular's height least.
std::shared_ptr<const SubjectShape> SolveShape(const ShapeHandles& habit, const Subject& subject);

}  // namespace sole::sim
