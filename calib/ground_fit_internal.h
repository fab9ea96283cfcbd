#pragma once

#include <vector>

#include <Eigen/Core>

#include "calib/ground.h"

namespace sole::calib {

/// A point of the glass top: what is left of a SheetPoint.
struct GroundSample {
  Eigen::Vector2d place_m;
  double height_m;  ///< above z = 0
  double weight;    ///< inverse variance
  int pair;
  bool from_below;
};

double Median(std::vector<double> values);

/// Weighted least-squares plane.
HeightPlane FitPlane(const std::vector<GroundSample>& samples);

/// Lays the grid over the samples, fits plane and residual of `surface`, and leaves out samples far
/// from it, until none is. Returns the number of samples left out. `samples` must not be empty.
int FitGrid(GroundSurface& surface, std::vector<GroundSample>& samples,
            const GroundOptions& options);

}  // namespace sole::calib
