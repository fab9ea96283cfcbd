#include "model/forward.h"

#include <fmt/format.h>

#include <cstddef>

#include "core/error.h"
#include "model/constraints.h"
#include "model/contact_network.h"
#include "model/skeleton.h"

namespace sole::model {

ModelParameters RestParameters(const FootModel& model) {
  ModelParameters parameters;
  parameters.theta = Eigen::MatrixX3d::Zero(model.NumJoints(), 3);
  parameters.beta = Eigen::VectorXd::Zero(model.NumBetas());
  return parameters;
}

void CheckParameters(const FootModel& model, const ModelParameters& parameters) {
  Require(model.derived.joints_m.rows() == model.NumJoints(),
          "foot model: evaluated before it was prepared");
  Require(parameters.theta.rows() == model.NumJoints(),
          fmt::format("foot model: pose of {} joints given, the model has {}",
                      parameters.theta.rows(), model.NumJoints()));
  Require(parameters.beta.size() <= model.NumBetas(),
          fmt::format("foot model: {} shape coefficients given, the model has {}",
                      parameters.beta.size(), model.NumBetas()));
  Require(parameters.contact.size() == 0 || parameters.contact.size() == model.NumVertices(),
          fmt::format("foot model: contact of {} vertices given, the model has {}",
                      parameters.contact.size(), model.NumVertices()));
}

Eigen::MatrixX3d RestVertices(const FootModel& model, const ModelParameters& parameters,
                              Variant variant) {
  CheckParameters(model, parameters);
  const ModelSurface& surface = SurfaceOf(model, variant);
  Eigen::Matrix3Xd positions = surface.template_m.transpose();
  Eigen::Map<Eigen::VectorXd> stacked(positions.data(), positions.size());
  stacked += surface.shapedirs.leftCols(parameters.beta.size()) * parameters.beta;
  if (surface.posedirs.cols() > 0)
    stacked += surface.posedirs * ConstrainedPoseFeatures(model, parameters.theta, parameters.beta);
  const Eigen::VectorXd offsets =
      ContactOffsets(model, variant, parameters.theta, parameters.beta, parameters.contact);
  if (offsets.size() > 0) stacked += offsets;
  return positions.transpose();
}

Eigen::MatrixX3d RestJoints(const FootModel& model, const Eigen::VectorXd& beta) {
  return PoseSkeleton(model, Eigen::MatrixX3d::Zero(model.NumJoints(), 3), beta).joints.transpose();
}

PosedFoot Forward(const FootModel& model, const ModelParameters& parameters, Variant variant) {
  const Eigen::MatrixX3d rest = RestVertices(model, parameters, variant);
  const Skeleton skeleton = PoseSkeleton(model, parameters.theta, parameters.beta);
  const DerivedModelData::Influences& influences = InfluencesOf(model, variant);
  PosedFoot posed;
  posed.joints_m = skeleton.joints.transpose().rowwise() + parameters.translation_m.transpose();
  posed.vertices_m.resize(rest.rows(), 3);
  for (Eigen::Index i = 0; i < rest.rows(); ++i) {
    const Eigen::Vector3d point = rest.row(i);
    Eigen::Vector3d sum = parameters.translation_m;
    const auto at = static_cast<std::size_t>(i);
    for (auto e = static_cast<std::size_t>(influences.start[at]);
         e < static_cast<std::size_t>(influences.start[at + 1]); ++e) {
      const int joint = influences.joint[e];
      sum += influences.weight[e] * (skeleton.rotations[static_cast<std::size_t>(joint)] * point +
                                     skeleton.offsets.col(joint));
    }
    posed.vertices_m.row(i) = sum;
  }
  return posed;
}

}  // namespace sole::model
