#pragma once

#include <random>
#include <vector>

#include "sim/motion.h"

namespace sole::sim {

/// Motions in which the foot comes down on the plate and (but for the jump) leaves it again, in real time: "walk" (heel strike,
/// flat, heel off and toe off at 0, 10, 40 and 60 % of a cycle of about 1.1 s), "run" (0.25 s on the ground) and "jump" (a
/// landing on both feet, then standing). A take that is longer than the motion's period starts over.
bool IsStepMotion(const std::string& name);

/// `placement` is where the foot stands flat. Throws Error for another motion's name.
std::vector<MotionFrame> MakeStepMotion(const Subject& subject, const MotionOptions& options, const Rigid3& placement,
                                        std::mt19937_64& random);

/// Shifts a frame without contact up or down until its lowest point is `height_m` above the plate.
void HoldAbovePlate(double height_m, MotionFrame& frame);

}  // namespace sole::sim
