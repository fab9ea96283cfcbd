#include "model/forward.h"

#include <fmt/format.h>

#include <cstddef>

#include "core/error.h"
#include "model/constraints.h"
#include "model/contact_network.h"
#include "model/kernels_internal.h"
#include "model/skeleton.h"

namespace sole::model {
namespace {

Eigen::Matrix3Xd CheckedRestVertices(const FootModel& model, const ModelParameters& parameters,
                                     Variant variant) {
  CheckParameters(model, parameters);
  return StackedRestVertices(model, parameters, variant,
                             ContactOffsets(model, variant, parameters.theta, parameters.beta,
                                            parameters.contact));
}

}  // namespace

ModelParameters RestParameters(const FootModel& model) {
  ModelParameters parameters;
  parameters.theta = Eigen::MatrixX3d::Zero(model.NumJoints(), 3);
  parameters.beta = Eigen::VectorXd::Zero(model.NumBetas());
  return parameters;
}

void CheckParameters(const FootModel& model, const ModelParameters& parameters) {
  Require(model.derived.joints_m.rows() == model.NumJoints(),
          "foot model: evaluated before it was prepared");
  // No message is composed for parameters that fit: that would take a tenth of the evaluation.
  if (parameters.theta.rows() != model.NumJoints())
    throw Error(fmt::format("foot model: pose of {} joints given, the model has {}",
                            parameters.theta.rows(), model.NumJoints()));
  if (parameters.beta.size() > model.NumBetas())
    throw Error(fmt::format("foot model: {} shape coefficients given, the model has {}",
                            parameters.beta.size(), model.NumBetas()));
  if (parameters.contact.size() != 0 && parameters.contact.size() != model.NumVertices())
    throw Error(fmt::format("foot model: contact of {} vertices given, the model has {}",
                            parameters.contact.size(), model.NumVertices()));
}

Eigen::Matrix3Xd StackedRestVertices(const FootModel& model, const ModelParameters& parameters,
                                     Variant variant, const Eigen::VectorXd& contact_offsets) {
  const ModelSurface& surface = SurfaceOf(model, variant);
  Eigen::Matrix3Xd positions = surface.template_m.transpose();
  const auto add = [&positions](const Eigen::MatrixXd& directions, const Eigen::MatrixXf& single,
                                const Eigen::VectorXd& values) {
    AddProduct<double>({directions.rows(), 1, values.size(), directions.data(), directions.rows(),
                        values.data(), values.size(), positions.data(), directions.rows(),
                        single.size() == directions.size() ? single.data() : nullptr});
  };
  const DerivedModelData::SingleSurface& single = SingleSurfaceOf(model, variant);
  add(surface.shapedirs, single.shapedirs, parameters.beta);
  if (surface.posedirs.cols() > 0)
    add(surface.posedirs, single.posedirs,
        ConstrainedPoseFeatures(model, parameters.theta, parameters.beta));
  if (contact_offsets.size() > 0)
    Eigen::Map<Eigen::VectorXd>(positions.data(), positions.size()) += contact_offsets;
  return positions;
}

Eigen::MatrixX3d RestVertices(const FootModel& model, const ModelParameters& parameters,
                              Variant variant) {
  return CheckedRestVertices(model, parameters, variant).transpose();
}

Eigen::MatrixX3d RestJoints(const FootModel& model, const Eigen::VectorXd& beta) {
  return PoseSkeleton(model, Eigen::MatrixX3d::Zero(model.NumJoints(), 3), beta).joints.transpose();
}

PosedFoot Forward(const FootModel& model, const ModelParameters& parameters, Variant variant) {
  Eigen::Matrix3Xd positions = CheckedRestVertices(model, parameters, variant);
  const Skeleton skeleton = PoseSkeleton(model, parameters.theta, parameters.beta);
  const Eigen::MatrixXd transforms = BoneTransforms(skeleton);
  const DerivedModelData::Influences& influences = InfluencesOf(model, variant);
  Skin<double>({positions.cols(), influences.start.data(), influences.joint.data(),
                influences.weight.data(), transforms.data(), parameters.translation_m.data(),
                positions.data(), positions.data()});
  PosedFoot posed;
  posed.joints_m = skeleton.joints.transpose().rowwise() + parameters.translation_m.transpose();
  posed.vertices_m = positions.transpose();
  return posed;
}

}  // namespace sole::model
