#pragma once

#include <string>
#include <vector>

#include "core/fit_sequence.h"
#include "model/foot_model.h"

namespace sole::model {

/// A measure of one foot in one frame, in metres.
struct FootMeasure {
  std::string name;
  double value_m = 0;
  double sd_m = 0;  ///< from the fit's covariance at the points that decide the value
};

/// Measures of a registered foot, definition version 1. The foot's frame has its ground at z = 0 and y along the
/// template's heel-to-second-toe axis, laid on the registration (rigid alignment), level with the ground:
///   length        extent along y below 60 mm
///   ball_width    largest extent along x between 0.55 and 0.80 of the length
///   heel_width    mean extent along x below 40 mm, between 0.13 and 0.19 of the length
///   instep_height highest point at half the length
///   arch_height   highest point of the sole (below 40 mm) between 0.36 and 0.52 of the length, 20 mm medial of the axis
/// Empty for a frame without a foot.
std::vector<FootMeasure> MeasureFrame(const FootModel& model, const FrameFit& frame, const GroundPlane& ground);

/// Whether the measures above are those of a standing foot: heel and ball within 4 mm of the ground. In the
/// air or on tiptoe they are numbers without a meaning.
bool StandsOnGround(const FootModel& model, const FrameFit& frame, const GroundPlane& ground);

}  // namespace sole::model
