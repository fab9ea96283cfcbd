#pragma once

#include "model/foot_model.h"

namespace sole::model {

/// The same foot with the joints of full-body models: the shank, the ankle (which carries the midfoot)
/// and the ball (all toes). Weights are summed; the ball's centre is the mean of the five toe joints
/// that hang on the midfoot. Correctives, activations, network and pose space are left out. Throws
/// Error where the tree is not that of a shank, an ankle, a midfoot and toes named `toe...`.
FootModel TwoJointModel(const FootModel& foot);

}  // namespace sole::model
