#include "model/upsampling.h"

#include <Eigen/Geometry>
#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <map>

#include "core/error.h"

namespace sole::model {
namespace {

std::size_t At(int index) { return static_cast<std::size_t>(index); }

/// Half the sum of the cotangents opposite each edge, at least a small positive number.
std::map<std::pair<int, int>, double> EdgeWeights(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, double> weights;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int corner = 0; corner < 3; ++corner) {
      const int a = t[(corner + 1) % 3], b = t[(corner + 2) % 3];
      const Eigen::Vector3d& apex = mesh.vertices[At(t[corner])];
      const Eigen::Vector3d to_a = mesh.vertices[At(a)] - apex, to_b = mesh.vertices[At(b)] - apex;
      weights[std::minmax(a, b)] += 0.5 * to_a.dot(to_b) / std::max(to_a.cross(to_b).norm(), 1e-15);
    }
  }
  for (auto& [edge, weight] : weights) weight = std::max(weight, 1e-3);
  return weights;
}

UpsamplingRow LargestOf(const Eigen::VectorXd& weights, int max_entries) {
  UpsamplingRow row;
  for (Eigen::Index c = 0; c < weights.size(); ++c) {
    if (weights[c] > 1e-6) row.emplace_back(static_cast<int>(c), weights[c]);
  }
  std::stable_sort(row.begin(), row.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  if (row.size() > At(max_entries)) row.resize(At(max_entries));
  std::sort(row.begin(), row.end());
  double sum = 0;
  for (const auto& entry : row) sum += entry.second;
  for (auto& entry : row) entry.second /= sum;
  return row;
}

}  // namespace

std::vector<UpsamplingRow> HarmonicUpsampling(const TriangleMesh& mesh, int num_coarse,
                                              int max_entries) {
  const int n = static_cast<int>(mesh.vertices.size());
  Require(num_coarse > 0 && num_coarse <= n && max_entries > 0,
          "upsampling: impossible number of coarse vertices or entries");
  std::vector<UpsamplingRow> rows;
  for (int i = 0; i < num_coarse; ++i) rows.push_back({{i, 1.0}});
  if (num_coarse == n) return rows;
  std::vector<Eigen::Triplet<double>> inner;
  Eigen::MatrixXd coupling = Eigen::MatrixXd::Zero(n - num_coarse, num_coarse);
  for (const auto& [edge, weight] : EdgeWeights(mesh)) {
    for (const auto& [i, j] : {edge, std::pair(edge.second, edge.first)}) {
      if (i < num_coarse) continue;
      inner.emplace_back(i - num_coarse, i - num_coarse, weight);
      if (j < num_coarse) {
        coupling(i - num_coarse, j) += weight;
      } else {
        inner.emplace_back(i - num_coarse, j - num_coarse, -weight);
      }
    }
  }
  Eigen::SparseMatrix<double> laplacian(n - num_coarse, n - num_coarse);
  laplacian.setFromTriplets(inner.begin(), inner.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(laplacian);
  Require(solver.info() == Eigen::Success, "upsampling: a part of the mesh holds no coarse vertex");
  const Eigen::MatrixXd weights = solver.solve(coupling);
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    rows.push_back(LargestOf(weights.row(i), max_entries));
    Require(!rows.back().empty(), "upsampling: a part of the mesh holds no coarse vertex");
  }
  return rows;
}

}  // namespace sole::model
