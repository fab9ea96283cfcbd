#pragma once

#include <utility>
#include <vector>

#include <Eigen/Core>
#include <ceres/cost_function.h>

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
/// translation.
class SurfaceCost : public ceres::CostFunction {
 public:
  SurfaceCost(const FootModel& model, const ModelParameters& shape, const Correspondences& matches)
      : model_(model), sizes_(shape), matches_(matches) {
    set_num_residuals(static_cast<int>(matches.places.size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(3 * model.NumJoints()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(shape.beta.size()));
    mutable_parameter_block_sizes()->push_back(3);
  }

  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    ModelParameters parameters = sizes_;
    for (Eigen::Index j = 0; j < parameters.theta.rows(); ++j) {
      for (Eigen::Index k = 0; k < 3; ++k) parameters.theta(j, k) = blocks[0][3 * j + k];
    }
    for (Eigen::Index b = 0; b < parameters.beta.size(); ++b) parameters.beta[b] = blocks[1][b];
    parameters.translation_m = Eigen::Vector3d(blocks[2][0], blocks[2][1], blocks[2][2]);
    const Variant variant = model_.HasFine() ? Variant::kFine : Variant::kCoarse;
    const ParameterColumns columns = ColumnsOf(model_, parameters);
    const Eigen::Index first[3] = {columns.theta, columns.beta, columns.translation};
    VisitSurfacePoints(
        model_, parameters, variant, matches_.places,
        [&](Eigen::Index m, const Eigen::Vector3d& position, const RowMatrix& rows) {
          const auto i = static_cast<std::size_t>(m);
          const Eigen::Vector3d n = matches_.weights[i] * matches_.normals[i];
          residuals[m] = n.dot(position - matches_.targets[i]);
          if (!jacobians) return;
          for (std::size_t block = 0; block < 3; ++block) {
            if (!jacobians[block]) continue;
            const int size = parameter_block_sizes()[block];
            Eigen::Map<Eigen::RowVectorXd>(jacobians[block] + m * size, size).noalias() =
                n.transpose() * rows.middleCols(first[block], size);
          }
        });
    return true;
  }

 private:
  const FootModel& model_;
  ModelParameters sizes_;
  const Correspondences& matches_;
};

/// Deviation of a block from zero, each value over its standard deviation; infinite ones do not count.
class PriorCost : public ceres::CostFunction {
 public:
  explicit PriorCost(Eigen::VectorXd weights) : weights_(std::move(weights)) {
    set_num_residuals(static_cast<int>(weights_.size()));
    mutable_parameter_block_sizes()->push_back(static_cast<int>(weights_.size()));
  }
  bool Evaluate(double const* const* blocks, double* residuals, double** jacobians) const override {
    for (Eigen::Index i = 0; i < weights_.size(); ++i) residuals[i] = weights_[i] * blocks[0][i];
    if (jacobians && jacobians[0]) {
      Eigen::Map<RowMatrix>(jacobians[0], weights_.size(), weights_.size()) = weights_.asDiagonal();
    }
    return true;
  }

 private:
  Eigen::VectorXd weights_;
};

}  // namespace sole::model
