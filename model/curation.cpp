#include "model/curation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <fmt/format.h>

#include "model/fit.h"
#include "model/foot_start.h"
#include "model/forward.h"
#include "model/mesh_topology.h"
#include "model/pose_prior.h"
#include "model/surface_query.h"
#include "model/triangle_topology.h"

namespace sole::model {
namespace {

/// Triangles by the cells of a grid that their boxes touch.
class TriangleGrid {
 public:
  TriangleGrid(const TriangleMesh& mesh, double cell_m) : cell_m_(cell_m) {
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
      Eigen::AlignedBox3d box;
      for (int k = 0; k < 3; ++k) box.extend(mesh.vertices[static_cast<std::size_t>(mesh.triangles[t][k])]);
      ForCells(box, [&](std::int64_t cell) { cells_[cell].push_back(static_cast<int>(t)); });
    }
  }
  /// Calls `visit` with triangles near the box, some more than once.
  template <typename Visit>
  void Near(const Eigen::AlignedBox3d& box, const Visit& visit) const {
    ForCells(box, [&](std::int64_t cell) {
      const auto found = cells_.find(cell);
      if (found == cells_.end()) return;
      for (const int t : found->second) visit(t);
    });
  }

 private:
  template <typename Visit>
  void ForCells(const Eigen::AlignedBox3d& box, const Visit& visit) const {
    const Eigen::Array3i low = (box.min() / cell_m_).array().floor().cast<int>(),
                         high = (box.max() / cell_m_).array().floor().cast<int>();
    for (int x = low.x(); x <= high.x(); ++x) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int z = low.z(); z <= high.z(); ++z)
          visit((std::int64_t{x} << 42) ^ ((std::int64_t{y} & 0x1fffff) << 21) ^ (std::int64_t{z} & 0x1fffff));
      }
    }
  }
  double cell_m_;
  std::unordered_map<std::int64_t, std::vector<int>> cells_;
};

/// Whether a segment goes through the inside of a triangle.
bool Crosses(const Eigen::Vector3d& from, const Eigen::Vector3d& to, const Eigen::Vector3d& a,
             const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d direction = to - from, e1 = b - a, e2 = c - a, p = direction.cross(e2);
  const double determinant = e1.dot(p);
  if (std::abs(determinant) < 1e-18) return false;
  const Eigen::Vector3d s = from - a, q = s.cross(e1);
  const double u = s.dot(p) / determinant, v = direction.dot(q) / determinant, t = e2.dot(q) / determinant;
  return u > 0 && v > 0 && u + v < 1 && t > 0 && t < 1;
}

Eigen::MatrixX3d SurfaceOf(const FrameFit& frame) {
  return frame.registration_fine_m.rows() > 0 ? frame.registration_fine_m : frame.registration_m;
}

void AssessScan(const TriangleMesh& surface, const TriangleMesh& fitted, const PointCloud& scan,
                const CurationOptions& options, RegistrationQuality& quality) {
  const SurfaceQuery query(surface);
  const RimPlane rim = RimPlaneOf(surface, BoundaryVertices(surface));
  std::vector<bool> covered(surface.vertices.size(), false);
  const PointCloud thinned = ThinForFit(scan, options.points);
  std::size_t near = 0, counted = 0;
  double sum = 0;
  for (const Eigen::Vector3f& point : thinned.points_m) {
    const Eigen::Vector3d p = point.cast<double>();
    if (rim.Beyond(p)) continue;
    ++counted;
    const auto hit = query.Closest(p, options.near_m);
    if (!hit) continue;
    ++near;
    sum += hit->distance_m;
    if (hit->distance_m > options.covered_m) continue;
    const Eigen::Vector3i& t = surface.triangles[static_cast<std::size_t>(hit->point.triangle)];
    for (int k = 0; k < 3; ++k) covered[static_cast<std::size_t>(t[k])] = true;
  }
  quality.residual_m = near ? sum / static_cast<double>(near) : options.near_m;
  quality.explained = counted ? static_cast<double>(near) / static_cast<double>(counted) : 0;
  const std::vector<double> areas = VertexAreas(surface);
  double all = 0, with_points = 0, departure = 0;
  for (std::size_t v = 0; v < areas.size(); ++v) {
    all += areas[v];
    if (!covered[v]) continue;
    with_points += areas[v];
    departure += areas[v] * (surface.vertices[v] - fitted.vertices[v]).norm();
  }
  quality.departure_m = with_points > 0 ? departure / with_points : 0;
  quality.coverage = all > 0 ? with_points / all : 0;
}

double EdgeStretch(const TriangleMesh& surface, const TriangleMesh& model) {
  std::vector<double> stretches;
  for (const auto& [a, b] : Edges(surface)) {
    const auto length = [&](const TriangleMesh& mesh) {
      return std::max(1e-7, (mesh.vertices[static_cast<std::size_t>(a)] - mesh.vertices[static_cast<std::size_t>(b)]).norm());
    };
    stretches.push_back(std::abs(std::log(length(surface) / length(model))));
  }
  if (stretches.empty()) return 0;
  const auto at = stretches.begin() + static_cast<std::ptrdiff_t>(0.95 * static_cast<double>(stretches.size() - 1));
  std::nth_element(stretches.begin(), at, stretches.end());
  return *at;
}

void AssessJump(const FrameFit& frame, const FrameFit& before, RegistrationQuality& quality) {
  if (before.registration_m.rows() != frame.registration_m.rows() || frame.registration_m.rows() < 3) return;
  const Eigen::Matrix4d moved = Eigen::umeyama(before.registration_m.transpose(), frame.registration_m.transpose(), false);
  const Eigen::Matrix3d turn = moved.topLeftCorner<3, 3>();
  const Eigen::Vector3d shift = moved.topRightCorner<3, 1>();
  quality.turned_rad = Eigen::AngleAxisd(turn).angle();
  quality.deformed_m = ((before.registration_m * turn.transpose()).rowwise() + shift.transpose() - frame.registration_m)
                           .rowwise().norm().mean();
}

std::string JointName(const FootModel& model, Eigen::Index joint) {
  const auto j = static_cast<std::size_t>(joint);
  return j < model.joint_names.size() ? model.joint_names[j] : fmt::format("joint {}", joint);
}

/// A toe that the scan does not show follows the others: it may be elsewhere though the rest of the foot fits.
void AssessParts(const FootModel& model, const FrameFit& frame, const CurationOptions& options, RegistrationQuality& quality) {
  Eigen::Index worst = 0;
  quality.bent = PosePriorOf(model).Deviations(frame.theta).maxCoeff(&worst);
  quality.bent_joint = JointName(model, worst);
  if (frame.vertex_sd_m.size() != model.NumVertices()) return;
  Eigen::VectorXd sums = Eigen::VectorXd::Zero(model.NumJoints()), counts = sums;
  for (Eigen::Index v = 0; v < model.NumVertices(); ++v) {
    Eigen::Index joint = 0;
    model.coarse.weights.row(v).maxCoeff(&joint);
    sums[joint] += frame.vertex_sd_m[v];
    counts[joint] += 1;
  }
  for (Eigen::Index j = 0; j < counts.size(); ++j) {
    if (counts[j] < options.part_vertices || sums[j] / counts[j] <= quality.vague_m) continue;
    quality.vague_m = sums[j] / counts[j];
    quality.vague_part = JointName(model, j);
  }
}

}  // namespace

double IntersectingEdges(const TriangleMesh& mesh) {
  const std::vector<std::pair<int, int>> edges = Edges(mesh);
  if (edges.empty()) return 0;
  const auto vertex = [&](int i) -> const Eigen::Vector3d& { return mesh.vertices[static_cast<std::size_t>(i)]; };
  double length = 0;
  for (const auto& [a, b] : edges) length += (vertex(a) - vertex(b)).norm();
  const double mean = length / static_cast<double>(edges.size());
  if (!(mean > 0) || !std::isfinite(mean)) return 0;
  const TriangleGrid grid(mesh, 2 * mean);
  std::size_t crossing = 0;
  for (const auto& edge : edges) {
    const int a = edge.first, b = edge.second;
    Eigen::AlignedBox3d box(vertex(a));
    box.extend(vertex(b));
    bool crosses = false;
    grid.Near(box, [&](int t) {
      const Eigen::Vector3i& c = mesh.triangles[static_cast<std::size_t>(t)];
      if (crosses || (c.array() == a).any() || (c.array() == b).any()) return;
      crosses = Crosses(vertex(a), vertex(b), vertex(c[0]), vertex(c[1]), vertex(c[2]));
    });
    crossing += crosses;
  }
  return static_cast<double>(crossing) / static_cast<double>(edges.size());
}

RegistrationQuality AssessRegistration(const FootModel& model, const Eigen::VectorXd& beta, const FrameFit& frame,
                                       const PointCloud& scan, const FrameFit* before,
                                       const CurationOptions& options) {
  RegistrationQuality quality;
  const Variant variant = frame.registration_fine_m.rows() > 0 ? Variant::kFine : Variant::kCoarse;
  const TriangleMesh surface = MeshOf(model, variant, SurfaceOf(frame));
  const ModelParameters parameters{frame.theta, beta, frame.translation_m, frame.contact};
  const TriangleMesh fitted = MeshOf(model, variant, Forward(model, parameters, variant).vertices_m);
  AssessScan(surface, fitted, scan, options, quality);
  // What the scan does not show is as wrong as the model; a person it fits badly is most wrong there.
  if (frame.vertex_sd_m.size() > 0) quality.unsure_m = (1 - quality.coverage) * frame.vertex_sd_m.mean();
  AssessParts(model, frame, options, quality);
  quality.intersecting = IntersectingEdges(surface);
  quality.stretch = EdgeStretch(surface, fitted);
  if (before && before->found) AssessJump(frame, *before, quality);
  return quality;
}

std::string CurationVerdict(const RegistrationQuality& q, const CurationOptions& o) {
  if (q.explained < o.min_explained)
    return fmt::format("poor fit: only {:.0f} % of the scan explained, {:.0f} % are needed", 100 * q.explained, 100 * o.min_explained);
  if (q.residual_m > o.max_residual_m)
    return fmt::format("poor fit: {:.2f} mm from the scan, at most {:.2f} mm are good", 1e3 * q.residual_m, 1e3 * o.max_residual_m);
  if (q.coverage < o.min_coverage)
    return fmt::format("poor coverage: {:.0f} % of the foot have scan points, {:.0f} % are needed", 100 * q.coverage, 100 * o.min_coverage);
  if (q.unsure_m > o.max_unsure_m)
    return fmt::format("unsure: {:.0f} % of the foot have no scan points, and the model alone is {:.1f} mm off", 100 * (1 - q.coverage), 1e3 * q.unsure_m / std::max(1e-3, 1 - q.coverage));
  if (q.vague_m > o.max_vague_m)
    return fmt::format("unsure: the scan hardly shows {}, known to {:.1f} mm, at most {:.1f} mm are good", q.vague_part, 1e3 * q.vague_m, 1e3 * o.max_vague_m);
  if (q.bent > o.max_bent)
    return fmt::format("no pose of a foot: {} is bent {:.0f} deviations away from known poses, at most {:.0f} are good", q.bent_joint, q.bent, o.max_bent);
  if (q.intersecting > o.max_intersecting)
    return fmt::format("self-intersection: {:.1f} % of the edges, at most {:.1f} % are good", 100 * q.intersecting, 100 * o.max_intersecting);
  if (q.stretch > o.max_stretch)
    return fmt::format("stretched: every 20th edge by a factor of {:.2f} against the model, at most {:.2f} is good", std::exp(q.stretch), std::exp(o.max_stretch));
  if (q.departure_m > o.max_departure_m)
    return fmt::format("no shape of a foot: {:.1f} mm from the fitted model, at most {:.1f} mm are good", 1e3 * q.departure_m, 1e3 * o.max_departure_m);
  if (q.turned_rad > o.max_turned_rad)
    return fmt::format("jump: turned by {:.0f} degrees from the frame before, at most {:.0f} are good", q.turned_rad * 180 / M_PI, o.max_turned_rad * 180 / M_PI);
  if (q.deformed_m > o.max_deformed_m)
    return fmt::format("jump: deformed by {:.1f} mm from the frame before, at most {:.1f} mm are good", 1e3 * q.deformed_m, 1e3 * o.max_deformed_m);
  return "good";
}

}  // namespace sole::model
