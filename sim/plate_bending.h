#pragma once

#include <span>
#include <vector>

namespace sole::sim {

/// A glass plate on supports along its edges. World frame: its unloaded top is z = 0, its middle the origin.
struct PlateModel {
  double size_x_m = 0.4;
  double size_y_m = 0.5;
  double thickness_m = 0.015;
  double young_pa = 70e9;  ///< float glass
  double poisson = 0.22;
};

struct PlateLoad {
  double x_m = 0, y_m = 0;  ///< world
  double force_n = 0;       ///< downwards
};

/// How far the glass top has gone down, on a regular grid over the plate. Without nodes the plate is rigid.
struct PlateSag {
  double size_x_m = 0, size_y_m = 0;
  int nodes_x = 0, nodes_y = 0;
  std::vector<double> down_m;  ///< node (i, j) at j * nodes_x + i, from the corner of least x and y

  /// Between the nodes, bilinear; 0 beyond the plate.
  double At(double x_m, double y_m) const;
};

/// Bends a simply supported rectangular Kirchhoff plate by Navier's double series (Timoshenko and Woinowsky-Krieger, Theory
/// of Plates and Shells, section 34):
///   w(x, y) = 4 / (pi^4 a b D) sum_mn sum_k P_k S_mn(x_k, y_k) S_mn(x, y) / (m^2 / a^2 + n^2 / b^2)^2,
///   S_mn(x, y) = sin(m pi x / a) sin(n pi y / b),  D = E t^3 / (12 (1 - nu^2)),  x and y from a corner.
/// Loads beyond the plate's edge are ignored. Throws Error for sizes or constants that no plate has.
PlateSag BendPlate(const PlateModel& plate, std::span<const PlateLoad> loads);

}  // namespace sole::sim
