#include "sim/foot_measures.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include <Eigen/Geometry>

#include "sim/reference_foot.h"

namespace sole::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Perimeter of the convex hull (Andrew's monotone chain), as a tape measure spans hollows.
double HullPerimeter(std::vector<Vector2d> points) {
  if (points.size() < 3) return 0;
  std::sort(points.begin(), points.end(),
            [](const Vector2d& a, const Vector2d& b) { return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y(); });
  std::vector<Vector2d> hull;
  for (int side = 0; side < 2; ++side) {
    const std::size_t base = hull.size();
    for (const Vector2d& p : points) {
      while (hull.size() >= base + 2) {
        const Vector2d u = hull.back() - hull[hull.size() - 2], v = p - hull.back();
        if (u.x() * v.y() - u.y() * v.x() > 0) break;
        hull.pop_back();
      }
      hull.push_back(p);
    }
    hull.pop_back();
    std::reverse(points.begin(), points.end());
  }
  double length = 0;
  for (std::size_t i = 0; i < hull.size(); ++i) length += (hull[i] - hull[(i + 1) % hull.size()]).norm();
  return length;
}

/// Foot with heel at y = 0 and x lateral.
struct Foot {
  std::vector<Vector3d> vertices;
  double length = 0;

  /// Hull perimeter of the section by the plane through `origin` spanned by unit u and v.
  double Girth(const Vector3d& origin, const Vector3d& u, const Vector3d& v) const {
    const Vector3d normal = u.cross(v);
    std::vector<double> height(vertices.size());
    for (std::size_t i = 0; i < height.size(); ++i) height[i] = normal.dot(vertices[i] - origin);
    std::vector<Vector2d> points;
    for (const Eigen::Vector3i& t : ReferenceFoot().triangles) {
      for (int i = 0; i < 3; ++i) {
        const auto a = static_cast<std::size_t>(t[i]), b = static_cast<std::size_t>(t[(i + 1) % 3]);
        if (a > b || (height[a] < 0) == (height[b] < 0)) continue;
        const double s = height[a] / (height[a] - height[b]);
        const Vector3d p = (1 - s) * vertices[a] + s * vertices[b] - origin;
        points.emplace_back(p.dot(u), p.dot(v));
      }
    }
    return HullPerimeter(std::move(points));
  }

  /// Mean of the points within 0.3 mm of the extreme along `direction` inside the box (fractions of the length).
  Vector3d Extreme(const Vector3d& direction, double y0, double y1, double z0, double z1) const {
    double best = -1;
    const auto inside = [&](const Vector3d& p) {
      return p.y() >= y0 * length && p.y() <= y1 * length && p.z() >= z0 * length && p.z() <= z1 * length;
    };
    for (const Vector3d& p : vertices) {
      if (inside(p)) best = std::max(best, direction.dot(p));
    }
    Vector3d sum = Vector3d::Zero();
    int count = 0;
    for (const Vector3d& p : vertices) {
      if (inside(p) && direction.dot(p) > best - 3e-4) sum += p, ++count;
    }
    if (count == 0) return Vector3d::Zero();
    const Vector3d mean = sum / count;
    return mean + direction * (best - direction.dot(mean));
  }
};

Foot Normalised(std::span<const Vector3d> vertices_m, Side side) {
  Foot foot;
  double heel = 1, tip = -1;
  for (const Vector3d& p : vertices_m) {
    if (p.z() > 0.06) continue;
    heel = std::min(heel, p.y());
    tip = std::max(tip, p.y());
  }
  foot.length = tip - heel;
  for (const Vector3d& p : vertices_m) foot.vertices.emplace_back(side == Side::kLeft ? -p.x() : p.x(), p.y() - heel, p.z());
  return foot;
}

/// Highest point of the sole under the medial arch, relative to the lowest of the foot.
double ArchHeight(const Foot& foot) {
  TriangleMesh mesh{foot.vertices, ReferenceFoot().triangles};
  const std::vector<Vector3d> normals = VertexNormals(mesh);
  const double medial = 0.077 * foot.length;
  double highest = 0, lowest = 1;
  for (std::size_t i = 0; i < foot.vertices.size(); ++i) {
    const Vector3d& p = foot.vertices[i];
    lowest = std::min(lowest, p.z());
    if (std::abs(p.x() + medial) > 0.0025 || normals[i].z() > -0.3) continue;
    if (p.y() > 0.36 * foot.length && p.y() < 0.52 * foot.length) highest = std::max(highest, p.z());
  }
  return highest - lowest;
}

}  // namespace

std::map<std::string, double> MeasureFoot(std::span<const Vector3d> vertices_m, Side side) {
  const Foot foot = Normalised(vertices_m, side);
  const double length = foot.length;
  const Vector3d x = Vector3d::UnitX(), y = Vector3d::UnitY(), z = Vector3d::UnitZ();
  const Vector3d ball_medial = foot.Extreme(-x, 0.62, 0.80, 0, 0.17);
  const Vector3d ball_lateral = foot.Extreme(x, 0.52, 0.75, 0, 0.17);
  const Vector3d heel_medial = foot.Extreme(-x, 0, 0.24, 0, 0.17), heel_lateral = foot.Extreme(x, 0, 0.24, 0, 0.17);
  const Vector3d ankle_medial = foot.Extreme(-x, 0.09, 0.34, 0.22, 0.40);
  const Vector3d ankle_lateral = foot.Extreme(x, 0.09, 0.34, 0.20, 0.38);
  const Vector3d instep = foot.Extreme(z, 0.49, 0.51, 0, 1);
  const Vector3d crease = foot.Extreme(z, 0.45, 0.47, 0, 1);
  const Vector3d heel(0, 0.027 * length, 0.03 * length);
  const Vector3d up_front = Vector3d(0, crease.y() - heel.y(), crease.z() - heel.z()).normalized();
  Vector3d across = ball_lateral - ball_medial;
  across.z() = 0;
  double ankle_girth = 1;
  for (double h = 0.40; h < 0.53; h += 0.02) {
    const double girth = foot.Girth(h * length * z, x, y);
    if (girth > 0.05) ankle_girth = std::min(ankle_girth, girth);
  }
  return {{"footlength", 1e3 * length},
          {"balloffootlength", 1e3 * ball_medial.y()},
          {"footbreadthhorizontal", 1e3 * (ball_lateral.x() - ball_medial.x())},
          {"balloffootcircumference", 1e3 * foot.Girth(ball_medial, across.normalized(), z)},
          {"heelbreadth", 1e3 * (heel_lateral.x() - heel_medial.x())},
          {"heelanklecircumference", 1e3 * foot.Girth(heel, x, up_front)},
          {"bimalleolarbreadth", 1e3 * (ankle_lateral.x() - ankle_medial.x())},
          {"lateralmalleolusheight", 1e3 * ankle_lateral.z()},
          {"anklecircumference", 1e3 * ankle_girth},
          {"instep_height", 1e3 * instep.z()},
          {"arch_height", 1e3 * ArchHeight(foot)}};
}

}  // namespace sole::sim
