#pragma once

#include "model/forward.h"

namespace sole::model {

/// The other side's foot: Forward(MirrorModel(m), MirrorParameters(m, p)) is the mirror image of
/// Forward(m, p) in the plane where coordinate m.mirror_axis is 0. Triangles are turned over so
/// that they stay counter-clockwise. Material points keep naming the right reference foot. Twice is
/// the identity.
FootModel MirrorModel(const FootModel& model);

/// Pose and translation of the mirror image; shape and contact stay.
ModelParameters MirrorParameters(const FootModel& model, const ModelParameters& parameters);

}  // namespace sole::model
