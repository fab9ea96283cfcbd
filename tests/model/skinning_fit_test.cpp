#include "model/skinning_fit.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "model/corrective_fit.h"
#include "model/joint_regressor_fit.h"
#include "random_model.h"

namespace sole::model {
namespace {

TEST(FitSkinningWeights, RecoversTheWeightsOfBlendedMotion) {
  std::mt19937_64 engine(81);
  const Eigen::Index n = 30, k = 5;
  Eigen::MatrixXd truth = Eigen::MatrixXd::Zero(n, k);
  for (Eigen::Index i = 0; i < n; ++i) {
    truth(i, i % k) = 0.75;
    truth(i, (i + 1) % k) += 0.25;
  }
  std::vector<PosedSample> samples;
  for (int s = 0; s < 12; ++s) {
    PosedSample sample{testing::RandomMatrix(engine, n, 3, 0.1), Eigen::MatrixX3d::Zero(n, 3), {}};
    for (Eigen::Index j = 0; j < k; ++j) {
      const Eigen::Vector4d q = testing::RandomMatrix(engine, 4, 1, 1);
      sample.posed_from_rest.push_back(
          {Eigen::Quaterniond(q).normalized(), testing::RandomMatrix(engine, 3, 1, 0.1)});
      for (Eigen::Index i = 0; i < n; ++i) {
        sample.posed_m.row(i) +=
            truth(i, j) *
            (sample.posed_from_rest.back() * sample.rest_m.row(i).transpose()).transpose();
      }
    }
    samples.push_back(sample);
  }
  const Eigen::MatrixXd prior = Eigen::MatrixXd::Constant(n, k, 0.2);
  const Eigen::MatrixXd weights = FitSkinningWeights(samples, prior, {.prior_weight_m = 1e-7});
  EXPECT_LT((weights - truth).cwiseAbs().maxCoeff(), 1e-6);
  // A joint without prior may not move a vertex.
  Eigen::MatrixXd masked = prior;
  masked(0, 0) = 0;
  EXPECT_EQ(FitSkinningWeights(samples, masked)(0, 0), 0);
}

TEST(FitSkinningWeights, KeepsToThePriorWhereDataSaysNothing) {
  std::mt19937_64 engine(82);
  const Eigen::MatrixX3d rest = testing::RandomMatrix(engine, 4, 3, 0.1);
  const PosedSample still{rest, rest, std::vector<Rigid3>(3)};
  Eigen::MatrixXd prior(4, 3);
  prior << 0.5, 0.3, 0.2, 1, 0, 0, 0, 0.5, 0.5, 0.1, 0.1, 0.8;
  EXPECT_LT(
      (FitSkinningWeights(std::vector<PosedSample>{still}, prior) - prior).cwiseAbs().maxCoeff(),
      1e-6);
}

TEST(FitJointRegressor, FollowsScaledAndMovedFeet) {
  std::mt19937_64 engine(83);
  const Eigen::MatrixX3d base = testing::RandomMatrix(engine, 60, 3, 0.05);
  Eigen::MatrixX3d base_joints(2, 3);
  base_joints << 0.01, 0.005, -0.01, -0.02, 0.01, 0.015;
  std::vector<Eigen::MatrixX3d> vertices, joints;
  for (int s = 0; s < 15; ++s) {
    const Eigen::Matrix3d map =
        Eigen::Matrix3d::Identity() + testing::RandomMatrix(engine, 3, 3, 0.1);
    const Eigen::RowVector3d shift = testing::RandomMatrix(engine, 1, 3, 0.05);
    vertices.emplace_back((base * map).rowwise() + shift);
    joints.emplace_back((base_joints * map).rowwise() + shift);
  }
  const Eigen::MatrixXd regressor = FitJointRegressor(vertices, joints, {.spread_m = 1e-5});
  for (std::size_t s = 0; s < vertices.size(); ++s)
    EXPECT_LT((regressor * vertices[s] - joints[s]).cwiseAbs().maxCoeff(), 1e-4);
  EXPECT_LT((regressor.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-12);
  EXPECT_LE((regressor.array() > 0).rowwise().count().maxCoeff(), 12);
}

TEST(FitCorrectives, RecoversMaskedLinearCorrectives) {
  std::mt19937_64 engine(84);
  const Eigen::Index n = 6, p = 8;
  Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic> allowed(n, p);
  Eigen::MatrixXd truth = testing::RandomMatrix(engine, 3 * n, p, 0.01);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index f = 0; f < p; ++f) {
      allowed(i, f) = (i + f) % 3 != 0;
      if (!allowed(i, f)) truth.block(3 * i, f, 3, 1).setZero();
    }
  }
  std::vector<Eigen::VectorXd> offsets, features;
  for (int s = 0; s < 40; ++s) {
    features.emplace_back(testing::RandomMatrix(engine, p, 1, 1));
    offsets.emplace_back(truth * features.back());
  }
  EXPECT_LT((FitCorrectives(offsets, features, allowed, 1e-12) - truth).cwiseAbs().maxCoeff(),
            1e-8);
  EXPECT_LT(FitCorrectives(offsets, features, allowed, 1e6).cwiseAbs().maxCoeff(), 1e-5);
  EXPECT_THROW(FitCorrectives(offsets, std::span(features).first(3), allowed, 1), Error);
}

}  // namespace
}  // namespace sole::model
