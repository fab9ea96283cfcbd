// Networks of every kind (told pose, shape, contact) and back-propagation through them.
#include "model/contact_network.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "core/error.h"
#include "model/forward_batch.h"
#include "model/jacobian.h"
#include "model/mirror.h"
#include "model/model_file.h"
#include "model/network_gradient.h"
#include "random_model.h"
#include "tests/support/error_matcher.h"
#include "tests/support/jacobian_checker.h"
#include "tests/support/temp_dir.h"

namespace sole::model {
namespace {

using ::testing::HasSubstr;
using testing::RandomMatrix;
using testing::RandomModel;
using testing::RandomParameters;
using testing_support::ErrorOf;

constexpr NetworkKind kKinds[] = {NetworkKind::kPose, NetworkKind::kPoseShape,
                                  NetworkKind::kPoseShapeContact};

/// The full network of a random model without the inputs that `kind` is not told.
FootModel Reduced(NetworkKind kind, unsigned seed) {
  FootModel model = RandomModel(Family::kSupr, seed);
  Eigen::MatrixXd& first = model.network.front().weight;
  first = first.leftCols(NumNetworkInputs(5, 12, kind)).eval();
  Prepare(model);
  return model;
}

/// The same with the missing inputs' weights at zero: it must be the same function.
FootModel Padded(const FootModel& reduced) {
  FootModel model = reduced;
  Eigen::MatrixXd& first = model.network.front().weight;
  const Eigen::Index given = first.cols();
  first.conservativeResize(Eigen::NoChange, NumNetworkInputs(5, 12));
  first.rightCols(first.cols() - given).setZero();
  Prepare(model);
  return model;
}

TEST(NetworkKinds, AreTheFullNetworkWithoutTheOtherInputs) {
  for (const NetworkKind kind : kKinds) {
    const FootModel model = Reduced(kind, 61), padded = Padded(model);
    EXPECT_EQ(KindOfNetwork(model), kind);
    const ModelParameters parameters = RandomParameters(model, 62);
    for (const Variant variant : {Variant::kCoarse, Variant::kFine}) {
      const Eigen::MatrixX3d wanted = Forward(padded, parameters, variant).vertices_m;
      EXPECT_LT((Forward(model, parameters, variant).vertices_m - wanted).cwiseAbs().maxCoeff(),
                1e-15);
      const std::vector<ModelParameters> batch = {parameters};
      const Eigen::Matrix3Xd columns = wanted.transpose();
      EXPECT_LT((ForwardBatch(model, batch, variant).vertices_m - columns.reshaped())
                    .cwiseAbs()
                    .maxCoeff(),
                1e-14);
      EXPECT_LT((VertexJacobian(model, parameters, variant).jacobian -
                 VertexJacobian(padded, parameters, variant).jacobian)
                    .cwiseAbs()
                    .maxCoeff(),
                1e-14);
      EXPECT_LT((VertexContactJacobian(model, parameters, variant) -
                 VertexContactJacobian(padded, parameters, variant))
                    .cwiseAbs()
                    .maxCoeff(),
                1e-14);
    }
  }
}

TEST(NetworkKinds, DependOnWhatTheyAreToldOnly) {
  for (const NetworkKind kind : kKinds) {
    const FootModel model = Reduced(kind, 63);
    ModelParameters parameters = RandomParameters(model, 64);
    const auto offsets = [&] {
      return ContactOffsets(model, Variant::kCoarse, parameters.theta, parameters.beta,
                            parameters.contact);
    };
    const Eigen::VectorXd before = offsets();
    parameters.contact = 1 - parameters.contact.array();
    EXPECT_EQ(offsets() != before, kind == NetworkKind::kPoseShapeContact);
    parameters = RandomParameters(model, 64);
    parameters.beta[1] += 1;
    EXPECT_EQ(offsets() != before, kind != NetworkKind::kPose);
    parameters = RandomParameters(model, 64);
    parameters.theta(2, 1) += 0.1;
    EXPECT_NE(offsets(), before);
  }
}

TEST(NetworkKinds, SurviveFileAndMirror) {
  const testing_support::TempDir dir;
  for (const NetworkKind kind : kKinds) {
    const FootModel model = Reduced(kind, 65);
    SaveModel(dir / "m.npz", model, {.single_precision = false});
    const FootModel read = LoadModel(dir / "m.npz");
    EXPECT_EQ(KindOfNetwork(read), kind);
    EXPECT_EQ(read.network.front().weight, model.network.front().weight);
    const ModelParameters parameters = RandomParameters(model, 66);
    Eigen::MatrixX3d wanted = Forward(model, parameters).vertices_m;
    wanted.col(model.mirror_axis) *= -1;
    const PosedFoot mirrored = Forward(MirrorModel(model), MirrorParameters(model, parameters));
    EXPECT_LT((mirrored.vertices_m - wanted).cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(NetworkKinds, OtherWidthsAreRefused) {
  FootModel model = Reduced(NetworkKind::kPoseShape, 67);
  Eigen::MatrixXd& first = model.network.front().weight;
  first = first.leftCols(21).eval();
  EXPECT_THAT(ErrorOf([&] { Prepare(model); }), HasSubstr("takes 21 inputs, expected 20 (pose)"));
}

TEST(BackPropagate, MatchesNumericDerivativesInWeightsAndInputs) {
  std::mt19937_64 engine(68);
  std::vector<NetworkLayer> layers = {{RandomMatrix(engine, 5, 4, 1), RandomMatrix(engine, 5, 1, 1)},
                                      {RandomMatrix(engine, 3, 5, 1), RandomMatrix(engine, 3, 1, 1)},
                                      {RandomMatrix(engine, 6, 3, 1), RandomMatrix(engine, 6, 1, 1)}};
  const Eigen::MatrixXd inputs = RandomMatrix(engine, 4, 7, 1), by_values = RandomMatrix(engine, 6, 7, 1);
  /// The loss whose derivative in the values is by_values.
  const auto loss = [&](const std::vector<NetworkLayer>& network, const Eigen::MatrixXd& given) {
    double sum = 0;
    for (Eigen::Index m = 0; m < given.cols(); ++m)
      sum += by_values.col(m).dot(EvaluateNetwork(network, given.col(m)));
    return Eigen::VectorXd::Constant(1, sum).eval();
  };
  const NetworkGradient gradient = BackPropagate(layers, inputs, by_values);
  testing_support::ExpectJacobianNear(
      [&](const Eigen::VectorXd& x) { return loss(layers, x.reshaped(4, 7)); }, inputs.reshaped(),
      gradient.inputs.reshaped().transpose(), 1e-8);
  for (std::size_t l = 0; l < layers.size(); ++l) {
    const NetworkLayer at = layers[l];
    testing_support::ExpectJacobianNear(
        [&](const Eigen::VectorXd& x) {
          std::vector<NetworkLayer> changed = layers;
          changed[l].weight = x.reshaped(at.weight.rows(), at.weight.cols());
          return loss(changed, inputs);
        },
        at.weight.reshaped(), gradient.layers[l].weight.reshaped().transpose(), 1e-8);
    testing_support::ExpectJacobianNear(
        [&](const Eigen::VectorXd& x) {
          std::vector<NetworkLayer> changed = layers;
          changed[l].bias = x;
          return loss(changed, inputs);
        },
        at.bias, gradient.layers[l].bias.transpose(), 1e-8);
  }
  EXPECT_THROW(BackPropagate(layers, inputs, by_values.topRows(5)), Error);
}

}  // namespace
}  // namespace sole::model
