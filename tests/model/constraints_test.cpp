#include "model/constraints.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "core/error.h"
#include "model/jacobian.h"
#include "model/mirror.h"
#include "random_model.h"
#include "tests/support/jacobian_checker.h"

namespace sole::model {
namespace {

using testing::RandomModel;
using testing::RandomParameters;

/// Joint 1 a hinge, joint 3 a double hinge.
FootModel HingedModel(unsigned seed) {
  FootModel model = RandomModel(Family::kSupr, seed, true, false);
  std::mt19937_64 engine(seed);
  model.constraints.resize(5);
  const auto axis = [&] {
    return Eigen::Vector3d(testing::RandomMatrix(engine, 3, 1, 1)).normalized();
  };
  model.constraints[1].axes = {axis()};
  model.constraints[3].axes = {axis(), axis()};
  Prepare(model);
  return model;
}

Eigen::VectorXd Stack(const Eigen::MatrixX3d& points) {
  const Eigen::Matrix3Xd transposed = points.transpose();
  return Eigen::Map<const Eigen::VectorXd>(transposed.data(), transposed.size());
}

TEST(LocalRotation, TurnsAHingeRightHandedAboutItsAxis) {
  FootModel model = HingedModel(1);
  model.constraints[1].axes = {Eigen::Vector3d::UnitZ()};
  Eigen::MatrixX3d theta = Eigen::MatrixX3d::Zero(5, 3);
  theta(1, 0) = 0.3;
  const Eigen::Vector3d turned = LocalRotation(model, theta, 1) * Eigen::Vector3d::UnitX();
  EXPECT_LT((turned - Eigen::Vector3d(std::cos(0.3), std::sin(0.3), 0)).norm(), 1e-15);
}

TEST(LocalRotation, SecondAxisOfADoubleHingeTurnsFirst) {
  FootModel model = HingedModel(2);
  model.constraints[3].axes = {Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitX()};
  Eigen::MatrixX3d theta = Eigen::MatrixX3d::Zero(5, 3);
  theta.row(3) << 0.4, -0.7, 0;
  const Eigen::Matrix3d expected = (Eigen::AngleAxisd(0.4, Eigen::Vector3d::UnitZ()) *
                                    Eigen::AngleAxisd(-0.7, Eigen::Vector3d::UnitX()))
                                       .toRotationMatrix();
  EXPECT_LT((LocalRotation(model, theta, 3) - expected).norm(), 1e-15);
}

TEST(ConstrainedPoseFeatures, OfADoubleHingeIsTheProductOfItsTwoFeatures) {
  const FootModel model = HingedModel(3);
  const ModelParameters p = RandomParameters(model, 4);
  const auto feature = [&](int which) {
    const Eigen::Quaterniond q(Eigen::AngleAxisd(
        p.theta(3, which), model.constraints[3].axes[static_cast<std::size_t>(which)]));
    return Eigen::Quaterniond(q.w() - 1, q.x(), q.y(), q.z());
  };
  const Eigen::Quaterniond product = feature(0) * feature(1);
  const Eigen::VectorXd features = ConstrainedPoseFeatures(model, p.theta, p.beta);
  EXPECT_LT((features.segment<4>(12) - product.coeffs()).norm(), 1e-15);
}

TEST(VertexJacobian, WithHingesMatchesNumericDerivatives) {
  const FootModel model = HingedModel(5);
  ModelParameters parameters = RandomParameters(model, 6);
  parameters.contact.resize(0);
  for (const double scale : {1.0, 0.0}) {
    parameters.theta *= scale;
    const auto unpack = [&](const Eigen::VectorXd& x) {
      ModelParameters p = parameters;
      p.theta = Eigen::Map<const Eigen::Matrix3Xd>(x.data(), 3, 5).transpose();
      return p;
    };
    const auto vertices = [&](const Eigen::VectorXd& x) {
      return Stack(Forward(model, unpack(x)).vertices_m);
    };
    const auto joints = [&](const Eigen::VectorXd& x) {
      return Stack(Forward(model, unpack(x)).joints_m);
    };
    const Eigen::VectorXd at = Stack(parameters.theta);
    testing_support::ExpectJacobianNear(
        vertices, at, VertexJacobian(model, parameters, Variant::kCoarse).jacobian.leftCols(15),
        2e-9);
    testing_support::ExpectJacobianNear(
        joints, at, JointJacobian(model, parameters).jacobian.leftCols(15), 2e-9);
  }
}

TEST(MirrorModel, WithHingesGivesTheMirrorImage) {
  FootModel model = HingedModel(7);
  for (int axis = 0; axis < 3; ++axis) {
    model.mirror_axis = axis;
    const ModelParameters parameters = RandomParameters(model, 8);
    PosedFoot wanted = Forward(model, parameters);
    wanted.vertices_m.col(axis) *= -1;
    const PosedFoot foot = Forward(MirrorModel(model), MirrorParameters(model, parameters));
    EXPECT_LT((foot.vertices_m - wanted.vertices_m).cwiseAbs().maxCoeff(), 1e-13);
  }
}

TEST(Prepare, RefusesHingesThatItCannotEvaluate) {
  FootModel model = HingedModel(9);
  model.constraints[1].axes[0] *= 2;
  EXPECT_THROW(Prepare(model), Error);
  model = HingedModel(9);
  model.constraints.pop_back();
  EXPECT_THROW(Prepare(model), Error);
  model = HingedModel(9);
  model.network = RandomModel(Family::kSupr, 9).network;
  EXPECT_THROW(Prepare(model), Error);
}

TEST(ThetaFrom, PutsFlatValuesInTheirPlaces) {
  FootModel model = HingedModel(10);
  EXPECT_EQ(NumPoseValues(model), 15);
  EXPECT_EQ(ThetaFrom(model, Eigen::VectorXd::LinSpaced(15, 0, 14))(3, 1), 10);
  model.pose_index = Eigen::MatrixX3i::Constant(5, 3, -1);
  model.pose_index(3, 1) = 0;
  model.pose_index(0, 2) = 1;
  EXPECT_EQ(NumPoseValues(model), 2);
  const Eigen::MatrixX3d theta = ThetaFrom(model, Eigen::Vector2d(0.5, -1));
  EXPECT_EQ(theta(3, 1), 0.5);
  EXPECT_EQ(theta(0, 2), -1);
  EXPECT_EQ(theta.sum(), -0.5);
  EXPECT_THROW(ThetaFrom(model, Eigen::VectorXd::Zero(15)), Error);
}

}  // namespace
}  // namespace sole::model
