#include <ceres/crs_matrix.h>
#include <ceres/manifold.h>

#include <Eigen/Cholesky>
#include <Eigen/SparseCore>
#include <cmath>

#include "calib/covariance_internal.h"
#include "core/error.h"

namespace sole::calib {
namespace {

/// J^T J, dense: a rig has some hundred parameters.
Eigen::MatrixXd NormalMatrix(const ceres::CRSMatrix& crs) {
  Eigen::SparseMatrix<double, Eigen::RowMajor> jacobian(crs.num_rows, crs.num_cols);
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(crs.values.size());
  for (int row = 0; row < crs.num_rows; ++row) {
    for (int i = crs.rows[static_cast<std::size_t>(row)];
         i < crs.rows[static_cast<std::size_t>(row) + 1]; ++i) {
      entries.emplace_back(row, crs.cols[static_cast<std::size_t>(i)],
                           crs.values[static_cast<std::size_t>(i)]);
    }
  }
  jacobian.setFromTriplets(entries.begin(), entries.end());
  return Eigen::MatrixXd(Eigen::SparseMatrix<double>(jacobian.transpose() * jacobian));
}

/// Adds the Jacobian columns of a block, as indices into the stacked parameters from `first` on.
/// Values a manifold holds fixed have no column.
void AppendColumns(const ceres::Problem& problem, double* block, Eigen::Index first,
                   std::vector<Eigen::Index>& parameter_of_column) {
  if (problem.IsParameterBlockConstant(block)) return;
  const ceres::Manifold* manifold = problem.GetManifold(block);
  const int size = problem.ParameterBlockSize(block),
            tangent = problem.ParameterBlockTangentSize(block);
  if (manifold == nullptr) {
    for (int i = 0; i < size; ++i) parameter_of_column.push_back(first + i);
    return;
  }
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> plus(size, tangent);
  manifold->PlusJacobian(block, plus.data());
  for (int column = 0; column < tangent; ++column) {
    Eigen::Index row = 0;
    plus.col(column).cwiseAbs().maxCoeff(&row);
    parameter_of_column.push_back(first + row);
  }
}

}  // namespace

Eigen::MatrixXd MarginalCovariance(ceres::Problem& problem, const std::vector<double*>& wanted,
                                   const std::vector<double*>& others) {
  ceres::Problem::EvaluateOptions evaluate;
  std::vector<Eigen::Index> parameter_of_column;
  Eigen::Index size = 0;
  for (double* block : wanted) {
    AppendColumns(problem, block, size, parameter_of_column);
    size += problem.ParameterBlockSize(block);
    // Ceres leaves constant blocks out of the Jacobian only if they are left out here.
    if (!problem.IsParameterBlockConstant(block)) evaluate.parameter_blocks.push_back(block);
  }
  evaluate.parameter_blocks.insert(evaluate.parameter_blocks.end(), others.begin(), others.end());
  ceres::CRSMatrix crs;
  problem.Evaluate(evaluate, nullptr, nullptr, nullptr, &crs);
  Eigen::MatrixXd normal = NormalMatrix(crs);

  // Unit diagonal, then one Cholesky factorisation: parameters differ by many orders of magnitude.
  const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt().cwiseInverse();
  normal = scale.asDiagonal() * normal * scale.asDiagonal();
  const Eigen::LLT<Eigen::MatrixXd> factor(normal);
  Require(scale.allFinite() && factor.info() == Eigen::Success,
          "calibration: the images do not determine all parameters; record more poses of the "
          "target, tilted and "
          "spread over every camera's image");
  const Eigen::Index columns = static_cast<Eigen::Index>(parameter_of_column.size());
  const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(normal.rows(), columns));

  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(size, size);
  for (Eigen::Index i = 0; i < columns; ++i) {
    for (Eigen::Index j = 0; j < columns; ++j) {
      covariance(parameter_of_column[static_cast<std::size_t>(i)],
                 parameter_of_column[static_cast<std::size_t>(j)]) =
          inverse(i, j) * scale[i] * scale[j];
    }
  }
  return covariance;
}

}  // namespace sole::calib
