#include "model/registration.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/error.h"
#include "model/surface_query.h"
#include "model/surface_system_internal.h"
#include "model/surface_topology.h"

namespace sole::model {
namespace {

/// A scan point and the place of the surface it belongs to.
struct Match {
  SurfacePoint point;  ///< also of unmatched points where something was near; triangle -1: nothing was
  Eigen::Vector3d normal;
  Eigen::Vector3d target;
  double weight = 0;  ///< 0 = unmatched
  double distance_m = 0;
};

/// Searches `radius_m` around every `stride`-th scan point, which stands for those left out. What the last search
/// found bounds where this one has to look.
void FindMatches(const TriangleMesh& surface, const SurfaceQuery& query, const std::vector<bool>& boundary,
                 const PointCloud& scan, double radius_m, std::size_t stride, const RegistrationOptions& options,
                 std::vector<Match>& matches) {
  const std::vector<Eigen::Vector3d> normals = VertexNormals(surface);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, scan.Size(), 256), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      Match& match = matches[i];
      match.weight = 0;
      if (i % stride != 0) continue;
      const Eigen::Vector3d p = scan.points_m[i].cast<double>();
      const double known = match.point.triangle < 0 ? radius_m : (PositionOf(surface, match.point) - p).norm();
      const auto hit = query.Closest(p, std::min(radius_m, known));
      if (!hit) {
        match.point.triangle = -1;
        continue;
      }
      match.point = hit->point;
      const Eigen::Vector3i& t = surface.triangles[static_cast<std::size_t>(hit->point.triangle)];
      Eigen::Vector3d normal = Eigen::Vector3d::Zero();
      double on_rim = 0;
      for (int k = 0; k < 3; ++k) {
        const auto v = static_cast<std::size_t>(t[k]);
        normal += hit->point.barycentric[k] * normals[v];
        on_rim += boundary[v] ? hit->point.barycentric[k] : 0;
      }
      normal.normalize();
      if (on_rim > 0.99) continue;  // the shank above the model
      if (!scan.normals.empty() &&
          scan.normals[i].cast<double>().dot(normal) < options.minimum_normal_cosine) {
        continue;
      }
      match = {hit->point, normal, p, static_cast<double>(stride), hit->distance_m};
    }
  });
}

/// Adds the quadratic form of one scan point.
void AddPoint(const Match& match, const Eigen::Vector3i& corners, const Eigen::Vector3i& edges,
              const Eigen::Vector3d& offset, double tangential, BlockSystem& system) {
  const Eigen::Matrix3d form =
      match.weight * ((1 - tangential) * match.normal * match.normal.transpose() +
                      tangential * Eigen::Matrix3d::Identity());
  const Eigen::Vector3d pull = form * offset;
  const Eigen::Vector3d& shares = match.point.barycentric;
  for (int k = 0; k < 3; ++k) {
    system.right.col(corners[k]) += shares[k] * pull;
    system.diagonal[static_cast<std::size_t>(corners[k])] += shares[k] * shares[k] * form;
    system.coupling[static_cast<std::size_t>(edges[k])] += shares[k] * shares[(k + 1) % 3] * form;
  }
}

/// One linear solve: displacements of all vertices from the model for fixed matches, sought from `start`.
Eigen::Matrix3Xd SolveDisplacements(const TriangleMesh& model, const SurfaceTopology& topology,
                                    const std::vector<Match>& matches, double stiffness,
                                    const Eigen::Matrix3Xd& start, const RegistrationOptions& options) {
  const std::size_t size = model.vertices.size();
  BlockSystem system{topology.edges, std::vector<Eigen::Matrix3d>(size, options.anchor * Eigen::Matrix3d::Identity()),
                     std::vector<Eigen::Matrix3d>(topology.edges.size(), -stiffness * Eigen::Matrix3d::Identity()),
                     Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(size))};
  for (const auto& [a, b] : topology.edges) {
    for (const int v : {a, b}) system.diagonal[static_cast<std::size_t>(v)].diagonal().array() += stiffness;
  }
  for (const Match& match : matches) {
    if (match.weight == 0) continue;
    const auto t = static_cast<std::size_t>(match.point.triangle);
    AddPoint(match, model.triangles[t], topology.triangle_edges[t], match.target - PositionOf(model, match.point),
             options.tangential, system);
  }
  // Displacements are millimetres: a millionth of the pull is far below the scan's noise.
  return Solve(system, start, 1e-6, 1000);
}

void Displace(const TriangleMesh& model, const Eigen::Matrix3Xd& displacements, TriangleMesh& moved) {
  for (std::size_t i = 0; i < moved.vertices.size(); ++i) {
    moved.vertices[i] = model.vertices[i] + displacements.col(static_cast<Eigen::Index>(i));
  }
}

/// Robust weights: Geman-McClure on the distance, with a scale that follows the median, and half of the
/// search radius at least: flesh pressed flat lies millimetres from the model and is no outlier.
void Reweight(double radius_m, std::vector<Match>& matches) {
  std::vector<double> distances;
  for (const Match& match : matches) {
    if (match.weight > 0) distances.push_back(match.distance_m);
  }
  if (distances.empty()) return;
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  const double scale2 = std::pow(std::max({4 * *middle, 2e-4, 0.5 * radius_m}), 2);
  for (Match& match : matches) {
    if (match.weight > 0) match.weight *= std::pow(scale2 / (scale2 + match.distance_m * match.distance_m), 2);
  }
}

/// Support and standard deviation per vertex. Where the scan has no points the deviation grows with the
/// distance along the surface to the nearest held vertex, by a tenth of it.
void Uncertainty(const TriangleMesh& model, const std::vector<std::pair<int, int>>& edges,
                 const PointCloud& scan, const std::vector<Match>& matches,
                 const RegistrationOptions& options, Registration& result) {
  const auto n = static_cast<Eigen::Index>(model.vertices.size());
  result.support = Eigen::VectorXd::Zero(n);
  Eigen::VectorXd information = Eigen::VectorXd::Zero(n);
  for (std::size_t i = 0; i < matches.size(); ++i) {
    if (matches[i].weight == 0) continue;
    const double sigma = scan.sigma_m.empty() ? options.point_sigma_m : std::max(1e-6f, scan.sigma_m[i]);
    const Eigen::Vector3i& t = model.triangles[static_cast<std::size_t>(matches[i].point.triangle)];
    for (int k = 0; k < 3; ++k) {
      const double share = matches[i].weight * matches[i].point.barycentric[k];
      result.support[t[k]] += share;
      information[t[k]] += share / (sigma * sigma);
    }
  }
  result.sd_m = Eigen::VectorXd::Constant(n, 1.0);
  for (Eigen::Index i = 0; i < n; ++i) {
    if (result.support[i] >= 0.5) result.sd_m[i] = 1 / std::sqrt(information[i]);
  }
  constexpr double kGrowth = 0.1;
  for (bool changed = true; changed;) {
    changed = false;
    for (const auto& [a, b] : edges) {
      const double length =
          (model.vertices[static_cast<std::size_t>(a)] - model.vertices[static_cast<std::size_t>(b)]).norm();
      for (const auto& [from, to] : {std::pair(a, b), std::pair(b, a)}) {
        const double reached = result.sd_m[from] + kGrowth * length;
        if (result.support[to] < 0.5 && reached < result.sd_m[to] - 1e-12) {
          result.sd_m[to] = reached;
          changed = true;
        }
      }
    }
  }
}

}  // namespace

Registration RegisterFree(const TriangleMesh& model, const PointCloud& scan,
                          const RegistrationOptions& options) {
  Require(options.iterations >= 1 && options.search_radius_m > 0 && options.final_radius_m > 0 &&
              options.stiffness > 0 && options.final_stiffness > 0 && options.anchor > 0 && options.early_points > 0,
          "registration: iterations, radii, stiffness, anchor and points must be positive");
  const SurfaceTopology topology = TopologyOf(model);
  TriangleMesh surface = model;
  SurfaceQuery query(surface);
  std::vector<Match> matches(scan.Size());
  Eigen::Matrix3Xd displacements = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(model.vertices.size()));
  for (int i = 0; i < options.iterations; ++i) {
    const double progress = options.iterations == 1 ? 1.0 : double(i) / (options.iterations - 1);
    const double radius =
        options.search_radius_m * std::pow(options.final_radius_m / options.search_radius_m, progress);
    const double stiffness = options.stiffness * std::pow(options.final_stiffness / options.stiffness, progress);
    const std::size_t stride = i + 2 < options.iterations ? std::max<std::size_t>(1, scan.Size() / options.early_points) : 1;
    FindMatches(surface, query, topology.boundary, scan, radius, stride, options, matches);
    Reweight(radius, matches);
    displacements = SolveDisplacements(model, topology, matches, stiffness, displacements, options);
    Displace(model, displacements, surface);
    query.Move(surface.vertices);
  }

  Registration result;
  FindMatches(surface, query, topology.boundary, scan, options.final_radius_m, 1, options, matches);
  double sum = 0;
  std::size_t found = 0;
  for (const Match& match : matches) {
    if (match.weight == 0) continue;
    sum += match.distance_m;
    ++found;
  }
  result.residual_m = found ? sum / static_cast<double>(found) : 0;
  result.matched = scan.Size() ? static_cast<double>(found) / static_cast<double>(scan.Size()) : 0;
  result.vertices_m.resize(static_cast<Eigen::Index>(surface.vertices.size()), 3);
  for (std::size_t i = 0; i < surface.vertices.size(); ++i) {
    result.vertices_m.row(static_cast<Eigen::Index>(i)) = surface.vertices[i].transpose();
  }
  Uncertainty(model, topology.edges, scan, matches, options, result);
  return result;
}

}  // namespace sole::model
