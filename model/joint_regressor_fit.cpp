#include "model/joint_regressor_fit.h"

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

#include "core/error.h"
#include "model/simplex_fit.h"

namespace sole::model {
namespace {

/// The vertices nearest to a joint in the mean of all samples.
std::vector<Eigen::Index> NearestVertices(const Eigen::MatrixX3d& vertices,
                                          const Eigen::RowVector3d& joint, int count) {
  std::vector<Eigen::Index> order(static_cast<std::size_t>(vertices.rows()));
  std::iota(order.begin(), order.end(), 0);
  const Eigen::VectorXd distances = (vertices.rowwise() - joint).rowwise().norm();
  std::stable_sort(order.begin(), order.end(),
                   [&](Eigen::Index a, Eigen::Index b) { return distances[a] < distances[b]; });
  order.resize(std::min(order.size(), static_cast<std::size_t>(count)));
  return order;
}

}  // namespace

Eigen::MatrixXd FitJointRegressor(std::span<const Eigen::MatrixX3d> vertices,
                                  std::span<const Eigen::MatrixX3d> joints,
                                  const JointRegressorOptions& options) {
  Require(!vertices.empty() && vertices.size() == joints.size(),
          "joint regressor: vertices and joints of the same samples are needed");
  Eigen::MatrixX3d mean_vertices = Eigen::MatrixX3d::Zero(vertices[0].rows(), 3),
                   mean_joints = Eigen::MatrixX3d::Zero(joints[0].rows(), 3);
  const double count = static_cast<double>(vertices.size());
  for (std::size_t s = 0; s < vertices.size(); ++s) {
    mean_vertices += vertices[s] / count;
    mean_joints += joints[s] / count;
  }
  Eigen::MatrixXd regressor = Eigen::MatrixXd::Zero(mean_joints.rows(), mean_vertices.rows());
  for (Eigen::Index j = 0; j < mean_joints.rows(); ++j) {
    const std::vector<Eigen::Index> candidates =
        NearestVertices(mean_vertices, mean_joints.row(j), options.candidates);
    const auto m = static_cast<Eigen::Index>(candidates.size());
    Eigen::MatrixXd h =
        options.spread_m * options.spread_m * count * Eigen::MatrixXd::Identity(m, m);
    Eigen::Matrix3Xd arms(3, m);
    for (std::size_t s = 0; s < vertices.size(); ++s) {
      for (Eigen::Index c = 0; c < m; ++c)
        arms.col(c) = vertices[s].row(candidates[static_cast<std::size_t>(c)]) - joints[s].row(j);
      h += arms.transpose() * arms;
    }
    const Eigen::VectorXd weights = FitOnSimplex(h, Eigen::VectorXd::Zero(m), options.max_vertices);
    for (Eigen::Index c = 0; c < m; ++c)
      regressor(j, candidates[static_cast<std::size_t>(c)]) = weights[c];
  }
  return regressor;
}

}  // namespace sole::model
