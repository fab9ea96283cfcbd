#include "model/shape_space.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "core/error.h"
#include "random_model.h"

namespace sole::model {
namespace {

TEST(LearnShapeSpace, FindsScaledComponentsOfALinearModel) {
  std::mt19937_64 engine(61);
  const Eigen::VectorXd mean = testing::RandomMatrix(engine, 30, 1, 1);
  // Two orthogonal directions with standard deviations 2 and 0.5.
  Eigen::VectorXd a = testing::RandomMatrix(engine, 30, 1, 1).normalized(),
                  b = testing::RandomMatrix(engine, 30, 1, 1);
  b = (b - a * a.dot(b)).normalized();
  const Eigen::MatrixXd codes = testing::RandomMatrix(engine, 2, 400, 1);
  const Eigen::MatrixXd shapes =
      ((2 * a * codes.row(0) + 0.5 * b * codes.row(1)).colwise() + mean).eval();
  const ShapeSpace space = LearnShapeSpace(shapes, 3);
  EXPECT_NEAR(space.components.col(0).norm(), 2, 0.2);
  EXPECT_NEAR(space.components.col(1).norm(), 0.5, 0.05);
  EXPECT_LT(space.components.col(2).norm(), 1e-6);
  EXPECT_NEAR(std::abs(space.components.col(0).normalized().dot(a)), 1, 1e-3);
  EXPECT_LT((space.mean - shapes.rowwise().mean()).norm(), 1e-12);
  // Codes recovered from the shapes have mean 0 and variance 1.
  const Eigen::VectorXd beta = (shapes.colwise() - space.mean).transpose() *
                               space.components.col(0) / space.components.col(0).squaredNorm();
  EXPECT_NEAR(beta.mean(), 0, 1e-12);
  EXPECT_NEAR(beta.squaredNorm() / 399, 1, 1e-9);
}

TEST(ShapeSum, ShapeByShapeGivesWhatAllAtOnceGives) {
  std::mt19937_64 engine(62);
  // 6 strong directions and weak noise; blocks of uneven size, one after the mean has moved.
  Eigen::MatrixXd shapes =
      testing::RandomMatrix(engine, 60, 6, 1) * testing::RandomMatrix(engine, 6, 90, 1) +
      testing::RandomMatrix(engine, 60, 90, 1e-3);
  shapes.rightCols(40).array() += 0.7;
  const ShapeSpace wanted = LearnShapeSpace(shapes, 5);
  for (const Eigen::Index rank : {12, 200}) {
    ShapeSum sum;
    sum.rank = rank;
    for (const auto& [first, size] : {std::pair<Eigen::Index, Eigen::Index>{0, 1}, {1, 49}, {50, 7}, {57, 33}})
      AddShapes(shapes.middleCols(first, size), sum);
    const ShapeSpace got = LearnShapeSpace(sum, 5);
    EXPECT_LT((got.mean - wanted.mean).norm(), 1e-12);
    EXPECT_LT((got.variances.head(7) - wanted.variances.head(7)).cwiseAbs().maxCoeff(), 1e-4);
    EXPECT_NEAR(got.variances.sum(), wanted.variances.sum(), 1e-9 * wanted.variances.sum());
    for (Eigen::Index c = 0; c < 5; ++c) {
      EXPECT_NEAR(std::abs(got.components.col(c).normalized().dot(wanted.components.col(c).normalized())), 1,
                  1e-6);
      EXPECT_NEAR(got.components.col(c).norm(), wanted.components.col(c).norm(), 1e-4);
    }
    EXPECT_LE(sum.directions.cols(), std::max<Eigen::Index>(rank, 94));
  }
}

TEST(LearnShapeSpace, NeedsMoreShapesThanComponents) {
  EXPECT_THROW(LearnShapeSpace(Eigen::MatrixXd::Zero(9, 4), 4), Error);
}

TEST(AlignRigidly, RecoversARigidMotionAndNeverMirrors) {
  std::mt19937_64 engine(62);
  const Eigen::MatrixX3d from = testing::RandomMatrix(engine, 20, 3, 0.1);
  Rigid3 motion{Eigen::Quaterniond(0.3, -0.5, 0.7, 0.2).normalized(), {0.1, -2, 3}};
  Eigen::MatrixX3d onto(20, 3);
  for (Eigen::Index i = 0; i < 20; ++i) onto.row(i) = motion * from.row(i).transpose();
  const Rigid3 found = AlignRigidly(from, onto);
  EXPECT_LT(found.rotation.angularDistance(motion.rotation), 1e-7);
  EXPECT_LT((found.translation - motion.translation).norm(), 1e-12);
  Eigen::MatrixX3d mirrored = onto;
  mirrored.col(0) *= -1;
  EXPECT_NEAR(AlignRigidly(from, mirrored).rotation.toRotationMatrix().determinant(), 1, 1e-9);
}

TEST(AlignRigidly, WeightsLeaveOutliersOut) {
  std::mt19937_64 engine(63);
  const Eigen::MatrixX3d from = testing::RandomMatrix(engine, 10, 3, 0.1);
  Eigen::MatrixX3d onto = from.rowwise() + Eigen::RowVector3d(1, 2, 3);
  onto.row(4) << 50, 60, 70;
  Eigen::VectorXd weights = Eigen::VectorXd::Ones(10);
  weights[4] = 0;
  EXPECT_LT((AlignRigidly(from, onto, weights).translation - Eigen::Vector3d(1, 2, 3)).norm(),
            1e-9);
}

}  // namespace
}  // namespace sole::model
