#include "model/train_correctives.h"

#include <tbb/parallel_for.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <functional>
#include <queue>
#include <utility>

#include "core/error.h"
#include "model/mesh_topology.h"
#include "model/train_joints.h"

namespace sole::model {
namespace {

constexpr double kFar = std::numeric_limits<double>::infinity();
constexpr int kSweeps = 60;

/// Starting activation of a joint on a vertex: the reciprocal distance, 1 on the ring.
double Nearness(double distance_m) {
  constexpr double kUnit = 0.01;
  return kUnit / (kUnit + distance_m);
}

/// Group lasso by block-coordinate descent: |o - f B|^2 / 2 + sum_g strength_g |B_g|, from the
/// products of f with itself (h) and with o (m). The block's own product is bounded by its trace, so
/// a step is a shrinkage and never goes too far.
Eigen::MatrixXd GroupLasso(const Eigen::MatrixXd& h, const Eigen::MatrixXd& m,
                           const Eigen::VectorXd& strengths) {
  Eigen::MatrixXd solution = Eigen::MatrixXd::Zero(m.rows(), m.cols());
  const double scale = m.norm();
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    double moved = 0;
    for (Eigen::Index g = 0; g < strengths.size(); ++g) {
      const double bound = h.block<4, 4>(4 * g, 4 * g).trace();
      if (bound <= 0) continue;
      const Eigen::Matrix<double, 4, 3> gradient =
          h.middleRows<4>(4 * g) * solution - m.middleRows<4>(4 * g);
      Eigen::Matrix<double, 4, 3> next = solution.middleRows<4>(4 * g) - gradient / bound;
      const double norm = next.norm(), threshold = strengths[g] / bound;
      next *= norm > threshold ? 1 - threshold / norm : 0;
      moved = std::max(moved, bound * (next - solution.middleRows<4>(4 * g)).norm());
      solution.middleRows<4>(4 * g) = next;
    }
    if (moved < 1e-6 * scale) break;
  }
  return solution;
}

/// Products with the ridge that keeps features that hardly vary small.
Eigen::MatrixXd WithRidge(const CorrectiveEvidence& evidence, std::size_t i, double ridge) {
  Eigen::MatrixXd h = evidence.products[i];
  if (h.rows() == 0) return h;
  h.diagonal().array() += ridge * evidence.count[static_cast<Eigen::Index>(i)] + 1e-12;
  return h;
}

/// Groups of a vertex that the L1 term leaves.
std::vector<int> ActiveGroups(const CorrectiveEvidence& evidence, const Eigen::MatrixXd& distances,
                              std::size_t i, double sparsity, double ridge) {
  const auto row = static_cast<Eigen::Index>(i);
  const std::vector<int>& joints = evidence.joints[i];
  Eigen::VectorXd strengths(static_cast<Eigen::Index>(joints.size()));
  for (std::size_t g = 0; g < joints.size(); ++g) {
    strengths[static_cast<Eigen::Index>(g)] =
        sparsity * evidence.count[row] / Nearness(distances(row, joints[g]));
  }
  const Eigen::MatrixXd solution =
      GroupLasso(WithRidge(evidence, i, ridge), evidence.moments[i], strengths);
  std::vector<int> active;
  for (std::size_t g = 0; g < joints.size(); ++g) {
    if (solution.middleRows<4>(4 * static_cast<Eigen::Index>(g)).squaredNorm() > 0)
      active.push_back(static_cast<int>(g));
  }
  return active;
}

/// Of the values of the first vertices' correctives those other than zero.
double Share(const std::vector<std::vector<int>>& active, Eigen::Index vertices,
             Eigen::Index joints) {
  std::size_t groups = 0;
  for (Eigen::Index i = 0; i < vertices; ++i) groups += active[static_cast<std::size_t>(i)].size();
  return static_cast<double>(groups) / static_cast<double>(vertices * joints);
}

}  // namespace

Eigen::VectorXd EdgeDistances(const TriangleMesh& mesh, std::span<const int> sources) {
  std::vector<std::vector<std::pair<int, double>>> ways(mesh.vertices.size());
  for (const auto& [a, b] : Edges(mesh)) {
    const auto from = static_cast<std::size_t>(a), to = static_cast<std::size_t>(b);
    const double length = (mesh.vertices[from] - mesh.vertices[to]).norm();
    ways[from].emplace_back(b, length);
    ways[to].emplace_back(a, length);
  }
  Eigen::VectorXd distance =
      Eigen::VectorXd::Constant(static_cast<Eigen::Index>(mesh.vertices.size()), kFar);
  using Reached = std::pair<double, int>;
  std::priority_queue<Reached, std::vector<Reached>, std::greater<>> open;
  for (const int source : sources) {
    distance[source] = 0;
    open.emplace(0, source);
  }
  while (!open.empty()) {
    const auto [so_far, vertex] = open.top();
    open.pop();
    if (so_far > distance[vertex]) continue;
    for (const auto& [next, length] : ways[static_cast<std::size_t>(vertex)]) {
      if (so_far + length >= distance[next]) continue;
      distance[next] = so_far + length;
      open.emplace(distance[next], next);
    }
  }
  return distance;
}

Eigen::MatrixXd RingDistances(const FootModel& foot) {
  const Eigen::MatrixXd subtree = SubtreeWeights(foot.fine.weights, foot.parents);
  const TriangleMesh mesh = TemplateMesh(foot, Variant::kFine);
  Eigen::MatrixXd distances = Eigen::MatrixXd::Constant(subtree.rows(), subtree.cols(), kFar);
  for (Eigen::Index j = 1; j < subtree.cols(); ++j) {
    std::vector<int> ring;
    for (Eigen::Index i = 0; i < subtree.rows(); ++i) {
      if (subtree(i, j) >= 0.3 && subtree(i, j) <= 0.7) ring.push_back(static_cast<int>(i));
    }
    if (!ring.empty()) distances.col(j) = EdgeDistances(mesh, ring);
  }
  return distances;
}

CorrectiveEvidence NoCorrectiveEvidence(const Eigen::MatrixXd& ring_distances_m,
                                        const CorrectiveOptions& options) {
  Require(options.reach_m > 0 && options.max_share > 0 && options.max_share <= 1 &&
              options.sparsity > 0 && options.ridge >= 0,
          "correctives: an option is out of its range");
  CorrectiveEvidence evidence;
  for (Eigen::Index i = 0; i < ring_distances_m.rows(); ++i) {
    std::vector<int> joints;
    for (Eigen::Index j = 1; j < ring_distances_m.cols(); ++j) {
      if (ring_distances_m(i, j) <= options.reach_m) joints.push_back(static_cast<int>(j));
    }
    const auto size = static_cast<Eigen::Index>(4 * joints.size());
    evidence.joints.push_back(std::move(joints));
    evidence.products.push_back(Eigen::MatrixXd::Zero(size, size));
    evidence.moments.push_back(Eigen::MatrixXd::Zero(size, 3));
  }
  evidence.count = evidence.squares = Eigen::VectorXd::Zero(ring_distances_m.rows());
  return evidence;
}

void AddEvidence(const Eigen::MatrixX3d& offsets_m, const Eigen::VectorXd& features,
                 const Eigen::VectorXd& counts, CorrectiveEvidence& evidence) {
  Require(offsets_m.rows() == evidence.count.size() && counts.size() == evidence.count.size(),
          "correctives: a sample's size does not fit the others");
  tbb::parallel_for(std::size_t{0}, evidence.joints.size(), [&](std::size_t i) {
    const auto row = static_cast<Eigen::Index>(i);
    if (counts[row] <= 0) return;
    const std::vector<int>& joints = evidence.joints[i];
    Eigen::VectorXd some(static_cast<Eigen::Index>(4 * joints.size()));
    for (std::size_t g = 0; g < joints.size(); ++g)
      some.segment<4>(4 * static_cast<Eigen::Index>(g)) = features.segment<4>(4 * joints[g]);
    const Eigen::VectorXd weighted = counts[row] * some;
    evidence.products[i].noalias() += weighted * some.transpose();
    evidence.moments[i].noalias() += weighted * offsets_m.row(row);
    evidence.count[row] += counts[row];
    evidence.squares[row] += counts[row] * offsets_m.row(row).squaredNorm();
  });
}

Correctives SolveCorrectives(const CorrectiveEvidence& evidence,
                             const Eigen::MatrixXd& ring_distances_m, Eigen::Index num_coarse,
                             const CorrectiveOptions& options) {
  const std::size_t vertices = evidence.joints.size();
  const Eigen::Index m = ring_distances_m.rows(), k = ring_distances_m.cols();
  Require(static_cast<Eigen::Index>(vertices) == m && num_coarse >= 1 && num_coarse <= m,
          "correctives: distances of other vertices");
  // What a corrective is worth that explains offsets of their own size by features of size 1.
  const double scale = std::sqrt(evidence.squares.sum() / std::max(1e-30, evidence.count.sum()));
  std::vector<std::vector<int>> active(vertices);
  Correctives result;
  for (result.sparsity = options.sparsity;; result.sparsity *= 1.5) {
    tbb::parallel_for(std::size_t{0}, vertices, [&](std::size_t i) {
      active[i] = ActiveGroups(evidence, ring_distances_m, i, result.sparsity * scale,
                               options.ridge);
    });
    result.share = std::max(Share(active, num_coarse, k), Share(active, m, k));
    if (result.share <= options.max_share) break;
  }
  result.posedirs = Eigen::MatrixXd::Zero(3 * m, 4 * k);
  result.activations = Eigen::MatrixXd::Zero(m, k);
  for (std::size_t i = 0; i < vertices; ++i) {
    if (active[i].empty()) continue;
    std::vector<Eigen::Index> used;
    for (const int g : active[i]) {
      for (int f = 0; f < 4; ++f) used.push_back(4 * g + f);
    }
    const Eigen::MatrixXd solved = WithRidge(evidence, i, options.ridge)(used, used).ldlt().solve(
        evidence.moments[i](used, Eigen::all));
    for (std::size_t g = 0; g < active[i].size(); ++g) {
      const auto row = static_cast<Eigen::Index>(i);
      const Eigen::Index joint = evidence.joints[i][static_cast<std::size_t>(active[i][g])];
      const Eigen::Matrix<double, 4, 3> block =
          solved.middleRows<4>(4 * static_cast<Eigen::Index>(g));
      result.posedirs.block<3, 4>(3 * row, 4 * joint) = block.transpose();
      result.activations(row, joint) = block.norm();
    }
  }
  for (Eigen::Index j = 0; j < k; ++j) {
    const double largest = result.activations.col(j).maxCoeff();
    if (largest > 0) result.activations.col(j) /= largest;
  }
  return result;
}

}  // namespace sole::model
