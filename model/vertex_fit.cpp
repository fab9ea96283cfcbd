#include "model/vertex_fit.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "model/jacobian.h"

namespace sole::model {
namespace {

ModelParameters Moved(const ModelParameters& from, const ParameterColumns& columns,
                      const Eigen::VectorXd& step) {
  ModelParameters to = from;
  const Eigen::Index joints = from.theta.rows();
  to.theta += Eigen::Map<const Eigen::Matrix3Xd>(step.data(), 3, joints).transpose();
  to.beta += step.segment(columns.beta, from.beta.size());
  to.translation_m += step.tail<3>();
  return to;
}

/// Prior information (inverse variances) per parameter, relative to data in units of sigma.
Eigen::VectorXd PriorInformation(const ModelParameters& start, const ParameterColumns& columns,
                                 const VertexFitOptions& options) {
  Eigen::VectorXd information = Eigen::VectorXd::Zero(columns.count);
  information.segment(3, columns.beta - 3)
      .setConstant(1 / (options.theta_sd_rad * options.theta_sd_rad));
  information.segment(columns.beta, start.beta.size())
      .setConstant(1 / (options.beta_sd * options.beta_sd));
  return information;
}

Eigen::VectorXd PriorResidual(const ModelParameters& parameters, const ParameterColumns& columns) {
  Eigen::VectorXd values = Eigen::VectorXd::Zero(columns.count);
  const Eigen::Matrix3Xd theta = parameters.theta.transpose();
  values.head(theta.size()) = Eigen::Map<const Eigen::VectorXd>(theta.data(), theta.size());
  values.segment(columns.beta, parameters.beta.size()) = parameters.beta;
  return values;
}

}  // namespace

VertexFitResult FitVertices(const FootModel& model, Variant variant,
                            const Eigen::MatrixX3d& targets_m, const ModelParameters& start,
                            const VertexFitOptions& options) {
  Require(targets_m.rows() == SurfaceOf(model, variant).NumVertices(),
          "vertex fit: one target per vertex is needed");
  Require(options.weights.size() == 0 || options.weights.size() == targets_m.rows(),
          "vertex fit: one weight per vertex is needed");
  const Eigen::VectorXd weights =
      options.weights.size() > 0 ? options.weights : Eigen::VectorXd::Ones(targets_m.rows());
  const Eigen::VectorXd roots = weights.cwiseSqrt();
  const ParameterColumns columns = ColumnsOf(model, start);
  const Eigen::VectorXd prior = PriorInformation(start, columns, options);
  const double information = 1 / (options.sigma_m * options.sigma_m);
  const auto cost_of = [&](const ModelParameters& parameters, const Eigen::MatrixX3d& points) {
    return information * (roots.asDiagonal() * (points - targets_m)).squaredNorm() +
           PriorResidual(parameters, columns).cwiseAbs2().dot(prior);
  };
  ModelParameters now = start;
  double damping = 1e-4;
  for (int iteration = 0; iteration < options.iterations; ++iteration) {
    PointsJacobian points = VertexJacobian(model, now, variant);
    const double cost = cost_of(now, points.points_m);
    const Eigen::Matrix3Xd residual =
        (points.points_m - targets_m).transpose() * roots.asDiagonal();
    for (Eigen::Index i = 0; i < roots.size(); ++i)
      points.jacobian.middleRows<3>(3 * i) *= roots[i];
    Eigen::MatrixXd normal = information * points.jacobian.transpose() * points.jacobian;
    Eigen::VectorXd gradient =
        information * points.jacobian.transpose() *
            Eigen::Map<const Eigen::VectorXd>(residual.data(), residual.size()) +
        prior.cwiseProduct(PriorResidual(now, columns));
    normal.diagonal() += prior;
    if (!options.fit_beta) {
      normal.middleRows(columns.beta, now.beta.size()).setZero();
      normal.middleCols(columns.beta, now.beta.size()).setZero();
      normal.diagonal().segment(columns.beta, now.beta.size()).setOnes();
      gradient.segment(columns.beta, now.beta.size()).setZero();
    }
    bool better = false;
    double gain = 0;
    for (int attempt = 0; attempt < 8 && !better; ++attempt) {
      Eigen::MatrixXd damped = normal;
      damped.diagonal() +=
          damping * normal.diagonal() + Eigen::VectorXd::Constant(columns.count, 1e-9);
      const ModelParameters next = Moved(now, columns, -damped.ldlt().solve(gradient));
      const double next_cost = cost_of(next, Forward(model, next, variant).vertices_m);
      better = next_cost < cost;
      gain = (cost - next_cost) / cost;
      damping = better ? std::max(damping / 10, 1e-9) : damping * 10;
      if (better) now = next;
    }
    if (!better || gain < 1e-7) break;
  }
  VertexFitResult result;
  result.parameters = now;
  const Eigen::VectorXd distances =
      (Forward(model, now, variant).vertices_m - targets_m).rowwise().norm();
  result.mean_distance_m = distances.mean();
  result.max_distance_m = distances.maxCoeff();
  return result;
}

}  // namespace sole::model
