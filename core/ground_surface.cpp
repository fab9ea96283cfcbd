#include "core/ground_surface.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

#include "core/error.h"

namespace sole {

double ResidualAt(const GroundSurface& surface, const Eigen::Vector2d& place_m) {
  if (surface.nodes_x < 2 || surface.nodes_y < 2) return 0;
  const Eigen::Vector2d node = (place_m - surface.first_node_m) / surface.spacing_m;
  const double x = std::clamp(node.x(), 0.0, surface.nodes_x - 1.0),
               y = std::clamp(node.y(), 0.0, surface.nodes_y - 1.0);
  const int i = std::min(static_cast<int>(x), surface.nodes_x - 2),
            j = std::min(static_cast<int>(y), surface.nodes_y - 2);
  const double a = x - i, b = y - j;
  const double* low = surface.residual_m.data() + j * surface.nodes_x + i;
  const double* high = low + surface.nodes_x;
  return (1 - b) * ((1 - a) * low[0] + a * low[1]) + b * ((1 - a) * high[0] + a * high[1]);
}

double HeightAt(const GroundSurface& surface, const Eigen::Vector2d& place_m) {
  return surface.plane.At(place_m) + ResidualAt(surface, place_m);
}

HeightPlane PlaneThrough(const std::vector<GroundMark>& marks) {
  Require(marks.size() >= 3, "a plane needs three fiducials, not " + std::to_string(marks.size()));
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const GroundMark& mark : marks) {
    const Eigen::Vector3d row(1, mark.point_m.x(), mark.point_m.y());
    const double weight = 1 / std::max(mark.sigma_m * mark.sigma_m, 1e-14);
    normal += weight * row * row.transpose();
    right += weight * mark.point_m.z() * row;
  }
  const Eigen::Vector3d plane = normal.ldlt().solve(right);
  return {plane[0], plane[1], plane[2]};
}

HeightPlane MarksPlane(const GroundSurface& surface) {
  return surface.marks.size() < 3 ? surface.plane : PlaneThrough(surface.marks);
}

}  // namespace sole
