#pragma once

#include <span>
#include <string>

#include "sim/gige/feature_table.h"

namespace sole::sim {

/// The GenICam description of a device with these features, as the device serves it from its
/// memory.
std::string GenicamXml(std::span<const Feature> features);

}  // namespace sole::sim
