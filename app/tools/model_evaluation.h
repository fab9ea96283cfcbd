#pragma once

#include <string>
#include <vector>

#include "model/foot_model.h"

namespace sole::tools {

/// Fits pose and shape of the model to the true material points of subjects 800, 801, ... (seeds
/// that no training uses): at rest, in random poses in the air, and standing at half and full body
/// weight. Lines of a table: mean and largest v2v in mm.
std::vector<std::string> EvaluateOnHeldOutPeople(const model::FootModel& foot, int people);

}  // namespace sole::tools
