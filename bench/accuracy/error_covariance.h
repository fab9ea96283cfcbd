#pragma once

#include <vector>

#include <Eigen/Core>

#include "sim/scan_noise.h"

namespace sole::bench {

/// A value on a surface at one moment.
struct FieldSample {
  int frame = 0;
  Eigen::Vector3d point_m;
  double value = 0;
};

/// Mean product of the values of two points of a frame, by their distance.
struct Covariance {
  double variance = 0;             ///< at distance 0
  std::vector<double> distance_m;  ///< mean of each class
  std::vector<double> value;
};
Covariance MeasureCovariance(const std::vector<FieldSample>& samples);

/// Shares of the variance by length (0, 1, 2, 4, 8 and 16 mm), not negative, that explain the
/// covariance best; they sum to 1.
std::vector<sim::NoiseComponent> FitComponents(const Covariance& covariance);

/// Distance at which the covariance has fallen to exp(-1/2) of its value between neighbours.
double FallLength(const Covariance& covariance);

/// Looks up whether a point is near.
class PointGrid {
 public:
  PointGrid(const std::vector<Eigen::Vector3f>& points_m, double cell_m);
  /// `radius_m` at most the cell's size.
  bool HasNear(const Eigen::Vector3d& point_m, double radius_m) const;

 private:
  double cell_m_;
  std::vector<std::pair<std::uint64_t, Eigen::Vector3f>> sorted_;
};

}  // namespace sole::bench
