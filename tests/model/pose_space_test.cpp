// Principal components of poses and the mixture of Gaussians in them.
#include "model/pose_space.h"

#include <gtest/gtest.h>

#include <Eigen/QR>
#include <cmath>
#include <random>

#include "model/mirror.h"
#include "model/model_file.h"
#include "random_model.h"
#include "tests/support/jacobian_checker.h"
#include "tests/support/temp_dir.h"

namespace sole::model {
namespace {

using testing::RandomMatrix;

/// Two clusters of poses in three of twelve dimensions, one of them twice as large.
Eigen::MatrixXd TwoKinds(unsigned seed, Eigen::Index count, Eigen::MatrixXd& axes) {
  std::mt19937_64 engine(seed);
  axes = RandomMatrix(engine, 12, 3, 1).householderQr().householderQ() *
         Eigen::MatrixXd::Identity(12, 3);
  Eigen::MatrixXd poses(count, 12);
  for (Eigen::Index p = 0; p < count; ++p) {
    Eigen::Vector3d at = RandomMatrix(engine, 3, 1, 0.1);
    at[0] += p % 3 == 0 ? 1.0 : -0.5;
    at[1] *= 2;
    poses.row(p) = (axes * at).transpose() + Eigen::RowVectorXd::Constant(12, 0.2) +
                   RandomMatrix(engine, 1, 12, 0.001);
  }
  return poses;
}

TEST(PoseSpace, FindsTheDirectionsAndTheKindsOfPose) {
  Eigen::MatrixXd axes;
  const Eigen::MatrixXd poses = TwoKinds(1, 900, axes);
  const PoseSpace space = LearnPoseSpace(poses, {.components = 3, .gaussians = 2});
  EXPECT_LT((space.components.transpose() * space.components - Eigen::Matrix3d::Identity()).norm(),
            1e-9);
  // The same three dimensions.
  EXPECT_NEAR((axes.transpose() * space.components).squaredNorm(), 3, 1e-3);
  EXPECT_GT(space.variances.head(3).sum() / space.variances.sum(), 0.99);
  ASSERT_EQ(space.weights.size(), 2);
  EXPECT_NEAR(space.weights.maxCoeff(), 2.0 / 3, 0.02);
  const Eigen::VectorXd a = space.mean + space.components * space.means.row(0).transpose(),
                        b = space.mean + space.components * space.means.row(1).transpose();
  EXPECT_NEAR((a - b).norm(), 1.5, 0.03);
  EXPECT_NEAR(std::abs((a - b).dot(axes.col(0))), 1.5, 0.03);
  // A pose between the kinds is less likely than one of each.
  const double middle = EnergyOf(space, 0.5 * (a + b)).value;
  EXPECT_GT(middle, EnergyOf(space, a).value + 5);
  EXPECT_GT(middle, EnergyOf(space, b).value + 5);
}

TEST(PoseSpace, EnergyIsTheLogDensityOfOneGaussian) {
  std::mt19937_64 engine(2);
  const Eigen::MatrixXd poses = RandomMatrix(engine, 4000, 3, 0.3);
  const PoseSpace space = LearnPoseSpace(poses, {.components = 3, .gaussians = 1});
  EXPECT_NEAR(EnergyOf(space, space.mean).value,
              1.5 * std::log(2 * M_PI) + 3 * std::log(0.3), 0.1);
  EXPECT_NEAR(EnergyOf(space, space.mean + Eigen::Vector3d(0.3, 0, 0)).value -
                  EnergyOf(space, space.mean).value,
              0.5, 0.05);
}

TEST(PoseSpace, GradientOfTheEnergyIsThatOfDifferences) {
  Eigen::MatrixXd axes;
  const PoseSpace space = LearnPoseSpace(TwoKinds(3, 600, axes), {.components = 3, .gaussians = 2});
  std::mt19937_64 engine(4);
  for (int i = 0; i < 5; ++i) {
    const Eigen::VectorXd at = space.mean + RandomMatrix(engine, 12, 1, 0.2);
    testing_support::ExpectJacobianNear(
        [&](const Eigen::VectorXd& pose) {
          return Eigen::VectorXd::Constant(1, EnergyOf(space, pose).value);
        },
        at, EnergyOf(space, at).gradient.transpose(), 1e-6);
  }
}

TEST(PoseSpace, FewPosesGetFewGaussians) {
  std::mt19937_64 engine(5);
  const PoseSpace space =
      LearnPoseSpace(RandomMatrix(engine, 8, 12, 0.2), {.components = 10, .gaussians = 6});
  EXPECT_EQ(space.weights.size(), 1);
  EXPECT_LE(space.components.cols(), 7);
  EXPECT_TRUE(std::isfinite(EnergyOf(space, space.mean).value));
}

TEST(PoseSpace, SurvivesFileAndMirror) {
  FootModel model = testing::RandomModel(Family::kSupr, 6);
  Eigen::MatrixXd axes;
  model.pose_space = LearnPoseSpace(TwoKinds(7, 300, axes), {.components = 3, .gaussians = 2});
  const testing_support::TempDir dir;
  SaveModel(dir / "m.npz", model, {.single_precision = false});
  const FootModel read = LoadModel(dir / "m.npz");
  std::mt19937_64 engine(8);
  ModelParameters pose = RestParameters(model);
  pose.theta = RandomMatrix(engine, 5, 3, 0.3);
  const double wanted = EnergyOf(model.pose_space, PoseValues(pose.theta)).value;
  EXPECT_DOUBLE_EQ(EnergyOf(read.pose_space, PoseValues(pose.theta)).value, wanted);
  // The mirrored pose is as likely to the mirrored model.
  EXPECT_NEAR(EnergyOf(MirrorModel(model).pose_space,
                       PoseValues(MirrorParameters(model, pose).theta))
                  .value,
              wanted, 1e-9);
}

}  // namespace
}  // namespace sole::model
