#pragma once

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

#include <Eigen/Core>
#include <ceres/cost_function.h>

#include "model/forward.h"
#include "model/jacobian.h"

namespace sole::model {

/// Correspondences of one round: scan points, places of the model surface and IRLS weights.
struct Correspondences {
  std::vector<SurfacePoint> places;
  std::vector<Eigen::Vector3d> targets;
  std::vector<Eigen::Vector3d> normals;
  std::vector<double> weights;  ///< square roots, with 1 / sigma and the effective number of points
  double cost = 0;
  double residual_m = 0;
  double matched = 0;
};

/// Point-to-plane distances of fixed correspondences. Parameters: theta (3K, joint by joint), beta,
/// translation. After `jacobians` Jacobians come zeros: Ceres asks for one more than it takes steps.
class SurfaceCost : public ceres::CostFunction {
 public:
  SurfaceCost(const FootModel& model, const ModelParameters& shape, const Correspondences& matches,
              int jacobians = std::numeric_limits<int>::max())
      : model_(model), sizes_(shape), matches_(matches), jacobians_left_(jacobians) {
    set_num_residuals(static_cast<int>(matches.places.size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(3 * model.NumJoints()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(shape.beta.size()));
    mutable_parameter_block_sizes()->push_back(3);
    // Several points share a vertex: each is differentiated once, in order, because the Jacobian is computed by blocks.
    const Eigen::MatrixX3i& triangles = SurfaceOf(model, SurfaceVariant()).triangles;
    std::vector<int> at(static_cast<std::size_t>(SurfaceOf(model, SurfaceVariant()).NumVertices()), -1);
    for (const SurfacePoint& place : matches.places) {
      for (int k = 0; k < 3; ++k) at[static_cast<std::size_t>(triangles(place.triangle, k))] = 0;
    }
    for (std::size_t v = 0; v < at.size(); ++v) {
      if (at[v] < 0) continue;
      at[v] = static_cast<int>(vertices_.size());
      vertices_.push_back(static_cast<int>(v));
    }
    for (const SurfacePoint& place : matches.places) {
      Eigen::Vector3i corners;
      for (int k = 0; k < 3; ++k) corners[k] = at[static_cast<std::size_t>(triangles(place.triangle, k))];
      corners_.push_back(corners);
    }
  }

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    ModelParameters parameters = sizes_;
    for (Eigen::Index j = 0; j < parameters.theta.rows(); ++j) {
      for (Eigen::Index k = 0; k < 3; ++k) parameters.theta(j, k) = blocks[0][3 * j + k];
    }
    for (Eigen::Index b = 0; b < parameters.beta.size(); ++b) parameters.beta[b] = blocks[1][b];
    parameters.translation_m = Eigen::Vector3d(blocks[2][0], blocks[2][1], blocks[2][2]);
    if (jacobians && jacobians_left_-- <= 0) {
      for (std::size_t block = 0; block < 3; ++block) {
        if (jacobians[block]) std::fill_n(jacobians[block], corners_.size() * static_cast<std::size_t>(parameter_block_sizes()[block]), 0.0);
      }
      jacobians = nullptr;
    }
    if (!jacobians) {
      const Eigen::MatrixX3d posed = Forward(model_, parameters, SurfaceVariant()).vertices_m;
      Eigen::MatrixX3d points(static_cast<Eigen::Index>(vertices_.size()), 3);
      for (std::size_t i = 0; i < vertices_.size(); ++i)
        points.row(static_cast<Eigen::Index>(i)) = posed.row(vertices_[i]);
      for (std::size_t m = 0; m < corners_.size(); ++m) residuals[m] = Residual(m, points);
      return true;
    }
    const ParameterColumns columns = ColumnsOf(model_, parameters);
    const Eigen::Index first[3] = {columns.theta, columns.beta, columns.translation};
    const PointsJacobian vertices = VertexJacobian(model_, parameters, SurfaceVariant(), vertices_);
    Eigen::RowVectorXd row(columns.count);
    for (std::size_t m = 0; m < corners_.size(); ++m) {
      residuals[m] = Residual(m, vertices.points_m);
      row.setZero();
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3d n =
            matches_.weights[m] * matches_.places[m].barycentric[k] * matches_.normals[m];
        for (int axis = 0; axis < 3; ++axis)
          row += n[axis] * vertices.jacobian.row(3 * corners_[m][k] + axis);
      }
      for (std::size_t block = 0; block < 3; ++block) {
        if (!jacobians[block]) continue;
        const int size = parameter_block_sizes()[block];
        Eigen::Map<Eigen::RowVectorXd>(jacobians[block] + static_cast<Eigen::Index>(m) * size, size) =
            row.segment(first[block], size);
      }
    }
    return true;
  }

 private:
  Variant SurfaceVariant() const { return model_.HasFine() ? Variant::kFine : Variant::kCoarse; }

  /// Of correspondence m, from the places of `vertices_`.
  double Residual(std::size_t m, const Eigen::MatrixX3d& points) const {
    Eigen::Vector3d position = Eigen::Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      position += matches_.places[m].barycentric[k] * points.row(corners_[m][k]).transpose();
    return matches_.weights[m] * matches_.normals[m].dot(position - matches_.targets[m]);
  }

  const FootModel& model_;
  ModelParameters sizes_;
  const Correspondences& matches_;
  mutable int jacobians_left_;            ///< the solver evaluates on one thread
  std::vector<int> vertices_;             ///< of the surface, those that a correspondence needs
  std::vector<Eigen::Vector3i> corners_;  ///< of every correspondence, in vertices_
};

/// Deviation of a block from a mean: root * (block - mean).
class PriorCost : public ceres::CostFunction {
 public:
  PriorCost(Eigen::MatrixXd root, Eigen::VectorXd mean) : root_(std::move(root)), mean_(std::move(mean)) {
    set_num_residuals(static_cast<int>(root_.rows()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(root_.cols()));
  }
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    const Eigen::Map<const Eigen::VectorXd> block(blocks[0], root_.cols());
    Eigen::Map<Eigen::VectorXd>(residuals, root_.rows()) = root_ * (block - mean_);
    if (jacobians && jacobians[0]) Eigen::Map<RowMatrix>(jacobians[0], root_.rows(), root_.cols()) = root_;
    return true;
  }

 private:
  Eigen::MatrixXd root_;
  Eigen::VectorXd mean_;
};

}  // namespace sole::model
