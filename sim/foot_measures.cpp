#include "sim/foot_measures.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include <Eigen/Geometry>

#include "sim/reference_foot.h"
#include "sim/subject_shape.h"

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

/// A point that measurers feel for and mark on the skin before they measure: the skin of the reference foot around a place.
/// All feet share its vertices, so the mark is on the same spot of anybody's foot.
class Landmark {
 public:
  Landmark(const Vector3d& on_reference_m, double radius_m) {
    const auto& reference = ReferenceFoot().vertices;
    for (std::size_t v = 0; v < reference.size(); ++v) {
      if ((reference[v] - on_reference_m).norm() < radius_m) vertices_.push_back(v);
    }
  }
  Vector3d Middle(std::span<const Vector3d> vertices) const {
    Vector3d sum = Vector3d::Zero();
    for (const std::size_t v : vertices_) sum += vertices[v];
    return sum / static_cast<double>(vertices_.size());
  }
  /// How far the patch reaches along `direction`: where a caliper's jaw rests.
  double Reach(std::span<const Vector3d> vertices, const Vector3d& direction) const {
    double most = -1;
    for (const std::size_t v : vertices_) most = std::max(most, direction.dot(vertices[v]));
    return most;
  }

 private:
  std::vector<std::size_t> vertices_;
};

constexpr double kMark_m = 0.004;   // a mark on the skin
constexpr double kKnob_m = 0.009;   // the bony prominence around it

/// Places on the reference foot: its most lateral and medial points at malleoli and metatarsal heads, and the skin over the
/// tuberosity of the navicular.
const Vector3d kLateralMalleolus(0.0341, 0.0470, 0.0800), kMedialMalleolus(-0.0405, 0.0602, 0.0934);
const Vector3d kFirstHead(-0.0484, 0.1922, 0.0241), kFifthHead(0.0453, 0.1648, 0.0156);
const Vector3d kNavicular(-0.0366, 0.1032, 0.0453);

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

  /// Largest extent along `direction` inside the box (fractions of the length).
  double Reach(const Vector3d& direction, double y0, double y1, double z0, double z1) const {
    double most = -1;
    for (const Vector3d& p : vertices) {
      if (p.y() < y0 * length || p.y() > y1 * length || p.z() < z0 * length || p.z() > z1 * length) continue;
      most = std::max(most, direction.dot(p));
    }
    return most;
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
    if (std::abs(p.x() + medial) > 0.0025 || normals[i].z() > -0.3 || p.z() > 0.17 * foot.length) continue;
    if (p.y() > 0.36 * foot.length && p.y() < 0.52 * foot.length) highest = std::max(highest, p.z());
  }
  return highest - lowest;
}

/// How far the tip of the second toe is ahead of the hallux's.
double SecondToeLead(const Foot& foot) {
  const std::vector<std::uint8_t>& charts = Binding().charts;
  double tips[3] = {-1, -1, -1};
  for (std::size_t v = 0; v < charts.size(); ++v) {
    if (charts[v] <= 2) tips[charts[v]] = std::max(tips[charts[v]], foot.vertices[v].y());
  }
  return tips[2] - tips[1];
}

/// Smallest horizontal girth from a thumb's length above the malleoli up.
double AnkleGirth(const Foot& foot, double malleolus_z) {
  double girth = 1;
  for (int i = 0; i <= 6; ++i) {
    const double z = malleolus_z + (0.10 + 0.02 * i) * foot.length;
    const double here = foot.Girth(z * Vector3d::UnitZ(), Vector3d::UnitX(), Vector3d::UnitY());
    if (here > 0.05) girth = std::min(girth, here);
  }
  return girth;
}

}  // namespace

double NavicularHeight(std::span<const Vector3d> vertices_m) {
  static const Landmark navicular(kNavicular, kMark_m);
  return 1e3 * navicular.Middle(vertices_m).z();
}

std::map<std::string, double> MeasureFoot(std::span<const Vector3d> vertices_m, Side side) {
  static const Landmark lateral_malleolus(kLateralMalleolus, kMark_m), lateral_knob(kLateralMalleolus, kKnob_m),
      medial_knob(kMedialMalleolus, kKnob_m), first_head(kFirstHead, kMark_m), fifth_head(kFifthHead, kMark_m);
  const Foot foot = Normalised(vertices_m, side);
  const double length = foot.length;
  const Vector3d x = Vector3d::UnitX(), z = Vector3d::UnitZ();
  const Vector3d ball_medial = first_head.Middle(foot.vertices), ball_lateral = fifth_head.Middle(foot.vertices);
  const Vector3d across = Vector3d(ball_lateral.x() - ball_medial.x(), ball_lateral.y() - ball_medial.y(), 0).normalized();
  const double malleolus_z = lateral_malleolus.Middle(foot.vertices).z();
  const Vector3d heel(0, 0.027 * length, 0.03 * length);
  const double crease_z = foot.Reach(z, 0.45, 0.47, 0, 1);
  const Vector3d up_front = Vector3d(0, 0.46 * length - heel.y(), crease_z - heel.z()).normalized();
  const auto width = [&](double y0, double y1, double y2, double y3) {
    return foot.Reach(x, y0, y1, 0, 0.17) + foot.Reach(-x, y2, y3, 0, 0.17);
  };
  return {{"footlength", 1e3 * length},
          {"balloffootlength", 1e3 * ball_medial.y()},
          {"footbreadthhorizontal", 1e3 * width(0.52, 0.75, 0.62, 0.80)},
          {"balloffootcircumference", 1e3 * foot.Girth(ball_medial, across, z)},
          {"heelbreadth", 1e3 * width(0, 0.24, 0, 0.24)},
          {"heelanklecircumference", 1e3 * foot.Girth(heel, x, up_front)},
          {"bimalleolarbreadth", 1e3 * (lateral_knob.Reach(foot.vertices, x) + medial_knob.Reach(foot.vertices, -x))},
          {"lateralmalleolusheight", 1e3 * malleolus_z},
          {"anklecircumference", 1e3 * AnkleGirth(foot, malleolus_z)},
          {"navicular_height", NavicularHeight(vertices_m)},
          {"instep_height", 1e3 * foot.Reach(z, 0.49, 0.51, 0, 1)},
          {"arch_height", 1e3 * ArchHeight(foot)},
          {"second_toe_lead", 1e3 * SecondToeLead(foot)}};
}

}  // namespace sole::sim
