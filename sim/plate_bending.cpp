#include "sim/plate_bending.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Core>

#include "core/error.h"

namespace sole::sim {
namespace {

constexpr int kTerms = 31;         // along each side; the 31st adds 0.02 % under a point load
constexpr double kCell_m = 0.01;   // of the grid; bilinear within 0.1 um between nodes under a body's weight

/// sin(m pi share) for m = 1 ... kTerms.
Eigen::VectorXd Sines(double share) {
  Eigen::VectorXd sines(kTerms);
  for (int m = 0; m < kTerms; ++m) sines[m] = std::sin((m + 1) * std::numbers::pi * share);
  return sines;
}

Eigen::MatrixXd SinesAtNodes(int nodes) {
  Eigen::MatrixXd sines(nodes, kTerms);
  for (int i = 0; i < nodes; ++i) sines.row(i) = Sines(static_cast<double>(i) / (nodes - 1)).transpose();
  return sines;
}

}  // namespace

double PlateSag::At(double x_m, double y_m) const {
  if (nodes_x < 2 || nodes_y < 2) return 0;
  const double x = (x_m / size_x_m + 0.5) * (nodes_x - 1), y = (y_m / size_y_m + 0.5) * (nodes_y - 1);
  if (!(x >= 0 && x <= nodes_x - 1 && y >= 0 && y <= nodes_y - 1)) return 0;
  const int i = std::min(static_cast<int>(x), nodes_x - 2), j = std::min(static_cast<int>(y), nodes_y - 2);
  const double u = x - i, v = y - j;
  const double* node = down_m.data() + static_cast<std::ptrdiff_t>(j) * nodes_x + i;
  return (1 - v) * ((1 - u) * node[0] + u * node[1]) + v * ((1 - u) * node[nodes_x] + u * node[nodes_x + 1]);
}

PlateSag BendPlate(const PlateModel& plate, std::span<const PlateLoad> loads) {
  const double a = plate.size_x_m, b = plate.size_y_m, t = plate.thickness_m;
  Require(a > 0 && b > 0 && t > 0 && plate.young_pa > 0 && std::abs(plate.poisson) < 0.5,
          "plate: sizes, thickness and modulus must be positive and Poisson's ratio below 0.5");
  Eigen::MatrixXd amplitude = Eigen::MatrixXd::Zero(kTerms, kTerms);  // m, n
  for (const PlateLoad& load : loads) {
    const double x = load.x_m / a + 0.5, y = load.y_m / b + 0.5;
    if (!(x > 0 && x < 1 && y > 0 && y < 1) || load.force_n == 0) continue;
    amplitude.noalias() += (load.force_n * Sines(x)) * Sines(y).transpose();
  }
  const double rigidity = plate.young_pa * t * t * t / (12 * (1 - plate.poisson * plate.poisson));
  for (int m = 1; m <= kTerms; ++m) {
    for (int n = 1; n <= kTerms; ++n) {
      const double waves = m * m / (a * a) + n * n / (b * b);
      amplitude(m - 1, n - 1) *= 4 / (std::pow(std::numbers::pi, 4) * a * b * rigidity * waves * waves);
    }
  }
  PlateSag sag{a, b, static_cast<int>(std::ceil(a / kCell_m)) + 1, static_cast<int>(std::ceil(b / kCell_m)) + 1, {}};
  sag.nodes_x = std::max(sag.nodes_x | 1, 3);  // odd, so that the middle is a node
  sag.nodes_y = std::max(sag.nodes_y | 1, 3);
  sag.down_m.resize(static_cast<std::size_t>(sag.nodes_x) * static_cast<std::size_t>(sag.nodes_y));
  Eigen::Map<Eigen::MatrixXd>(sag.down_m.data(), sag.nodes_x, sag.nodes_y).noalias() =
      SinesAtNodes(sag.nodes_x) * amplitude * SinesAtNodes(sag.nodes_y).transpose();
  return sag;
}

}  // namespace sole::sim
