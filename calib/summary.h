#pragma once

#include <array>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "core/rig.h"

namespace sole::calib {

/// Corners of the target in each ninth of a camera's image, row by row from the upper left.
std::array<int, 9> Coverage(const TakeObservations& observations, std::size_t camera, int width,
                            int height);

/// What to record next, one line each: cameras whose image has ninths without a corner, few poses.
std::vector<std::string> Advice(const Rig& rig, const TakeObservations& observations);

/// Standard deviations of a camera, from the covariance.
struct CameraSigmas {
  double centre_mm = 0;
  double direction_deg = 0;
  double focal_px = 0;
  double principal_px = 0;
};
/// In rig order; empty without a covariance.
std::vector<CameraSigmas> Sigmas(const Calibration& calibration);

/// Pairs of one camera's parameters, or of a camera and the plate's thickness, whose correlation
/// exceeds `limit` in size, in words, strongest first and at most `most` of them.
std::vector<std::string> StrongCorrelations(const Calibration& calibration, double limit = 0.95,
                                            std::size_t most = 10);

}  // namespace sole::calib
