#pragma once

#include <vector>

#include "model/foot_model.h"

namespace sole::tools {

/// Named coarse vertices of the template (right foot; x lateral, y towards the toes, z up):
/// heel_back, heel_bottom, toe1_tip ... toe5_tip, metatarsal1_medial, metatarsal5_lateral,
/// malleolus_medial, malleolus_lateral.
std::vector<model::Landmark> FindLandmarks(const model::FootModel& foot);

}  // namespace sole::tools
