#pragma once

/// The simulated foot: who (subject.h), in which pose (posing.h), on the plate (soft_contact.h), over time
/// (motion.h), and how long, wide and high it is (foot_measures.h).

#include "sim/foot_measures.h"  // IWYU pragma: export
#include "sim/motion.h"         // IWYU pragma: export
#include "sim/posing.h"         // IWYU pragma: export
#include "sim/reference_foot.h" // IWYU pragma: export
#include "sim/soft_contact.h"   // IWYU pragma: export
#include "sim/subject.h"        // IWYU pragma: export
