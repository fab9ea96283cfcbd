#pragma once

#include <vector>

#include <Eigen/Core>

#include "sim/anatomy_table.h"

namespace sole::sim {

/// Changes of the mean foot. Zero is the mean foot. Millimetres are those of the 260 mm foot before `scale`.
struct ShapeHandles {
  double scale = 0;                ///< relative, the whole foot
  double ball_length_mm = 0;       ///< moves the ball forward, heel and toe tips stay
  double foot_breadth = 0;         ///< relative width of ball and toes
  double ball_height = 0;          ///< relative height of the forefoot
  double heel_breadth = 0;         ///< relative
  double ankle_front_mm = 0;       ///< front of the ankle outwards
  double malleoli_breadth = 0;     ///< relative
  double ankle_height = 0;         ///< relative height of instep, malleoli and shank
  double shank_girth = 0;          ///< relative, above the malleoli
  double arch_height_mm = 0;
  double second_toe_length = 0;    ///< relative length of the second toe beyond its joint
  double hallux_valgus_rad = 0;    ///< turns the hallux laterally
  double toe_fan_rad = 0;          ///< opens the toes
};

/// Where the handles that are warps carry a point of the mean foot. `second_toe` in [0, 1]: how far the point belongs to the
/// second toe.
Eigen::Vector3d WarpedPoint(const ShapeHandles& handles, const Eigen::Vector3d& point, double second_toe);

/// The mean table with its control geometry warped and the toes turned.
AnatomyTable ShapedTable(const AnatomyTable& mean, const ShapeHandles& handles);

/// Points of the mean foot's skin carried along: warped, then turned with the toes. `shares` as ComputeBoneShares.
std::vector<Eigen::Vector3d> ShapedPoints(const AnatomyTable& mean, const ShapeHandles& handles,
                                          const Eigen::MatrixXf& shares, const std::vector<Eigen::Vector3d>& points);

}  // namespace sole::sim
