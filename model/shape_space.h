#pragma once

#include <Eigen/Core>
#include <span>

#include "core/rigid3.h"

namespace sole::model {

/// Principal components of shapes given as stacked coordinates.
struct ShapeSpace {
  Eigen::VectorXd mean;
  Eigen::MatrixXd components;  ///< columns scaled by their standard deviation: shape = mean +
                               ///< components * beta, beta ~ N(0, I)
  Eigen::VectorXd variances;   ///< of all components, largest first
};

/// PCA of the columns of `shapes` (coordinates x samples). At most samples - 1 components.
ShapeSpace LearnShapeSpace(const Eigen::MatrixXd& shapes, Eigen::Index num_components);

/// The same shape by shape, for more shapes than fit into memory: keeps the mean and the `rank`
/// strongest directions, exact where no more than `rank` of them vary.
struct ShapeSum {
  Eigen::Index rank = 0;
  Eigen::Index samples = 0;
  Eigen::VectorXd mean;
  Eigen::MatrixXd directions;  ///< columns; directions * directions^T is the scatter about the mean
  double scatter = 0;          ///< sum of squared distances from the mean, all directions
};

/// Adds the columns of `shapes`.
void AddShapes(const Eigen::MatrixXd& shapes, ShapeSum& sum);

/// As LearnShapeSpace. `variances` holds the kept directions' and, last, the sum of what was left
/// out.
ShapeSpace LearnShapeSpace(const ShapeSum& sum, Eigen::Index num_components);

/// Rigid motion that carries `from` onto `onto` with least squared distances (M x 3 each, weights
/// of M points or none).
Rigid3 AlignRigidly(const Eigen::MatrixX3d& from, const Eigen::MatrixX3d& onto,
                    const Eigen::VectorXd& weights = {});

}  // namespace sole::model
