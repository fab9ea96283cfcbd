#pragma once

#include <Eigen/Core>

#include "model/foot_model.h"

namespace sole::model {

/// Arguments of the forward function.
struct ModelParameters {
  Eigen::MatrixX3d theta;  ///< K x 3 axis-angle per joint, rad, root included
  Eigen::VectorXd beta;    ///< at most B shape coefficients, those left out are zero
  Eigen::Vector3d translation_m = Eigen::Vector3d::Zero();
  Eigen::VectorXd contact;  ///< N values in [0, 1] of the coarse vertices, or empty for none
};

/// theta, beta and translation zero, all B coefficients.
ModelParameters RestParameters(const FootModel& model);

/// Posed foot.
struct PosedFoot {
  Eigen::MatrixX3d vertices_m;  ///< N x 3 of the asked variant
  Eigen::MatrixX3d joints_m;    ///< K x 3
};

/// M(theta, beta, c, t) = W(T + B_S(beta) + B_P(theta) + B_C(theta, beta, c), J(beta), theta) + t.
/// `model` must be prepared (see Prepare). Throws Error where the parameters' sizes do not fit the
/// model.
PosedFoot Forward(const FootModel& model, const ModelParameters& parameters,
                  Variant variant = Variant::kCoarse);

/// T + B_S + B_P + B_C of a variant before skinning, N x 3.
Eigen::MatrixX3d RestVertices(const FootModel& model, const ModelParameters& parameters,
                              Variant variant = Variant::kCoarse);

/// The same with one column a vertex, 3 x N, and with B_C as given: 3N values or none.
Eigen::Matrix3Xd StackedRestVertices(const FootModel& model, const ModelParameters& parameters,
                                     Variant variant, const Eigen::VectorXd& contact_offsets);

/// Joints of the shaped, unposed template, K x 3.
Eigen::MatrixX3d RestJoints(const FootModel& model, const Eigen::VectorXd& beta);

/// Throws Error where the parameters' sizes do not fit the model.
void CheckParameters(const FootModel& model, const ModelParameters& parameters);

}  // namespace sole::model
