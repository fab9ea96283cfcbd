#include "model/simplex_fit.h"

#include <gtest/gtest.h>

#include "core/error.h"
#include "random_model.h"

namespace sole::model {
namespace {

double Value(const Eigen::MatrixXd& h, const Eigen::VectorXd& g, const Eigen::VectorXd& w) {
  return w.dot(h * w) - 2 * g.dot(w);
}

TEST(FitOnSimplex, RecoversSparseWeights) {
  std::mt19937_64 engine(71);
  for (int trial = 0; trial < 20; ++trial) {
    const Eigen::MatrixXd a = testing::RandomMatrix(engine, 30, 8, 1);
    Eigen::VectorXd truth = Eigen::VectorXd::Zero(8);
    truth[trial % 8] = 0.6;
    truth[(trial + 3) % 8] = 0.3;
    truth[(trial + 5) % 8] = 0.1;
    const Eigen::VectorXd w = FitOnSimplex(a.transpose() * a, a.transpose() * (a * truth), 4);
    EXPECT_LT((w - truth).cwiseAbs().maxCoeff(), 1e-6);
  }
}

TEST(FitOnSimplex, BeatsRandomFeasiblePoints) {
  std::mt19937_64 engine(72);
  for (int trial = 0; trial < 10; ++trial) {
    const Eigen::MatrixXd a = testing::RandomMatrix(engine, 12, 6, 1);
    const Eigen::VectorXd b = testing::RandomMatrix(engine, 12, 1, 1);
    const Eigen::MatrixXd h = a.transpose() * a;
    const Eigen::VectorXd g = a.transpose() * b;
    const Eigen::VectorXd w = FitOnSimplex(h, g, 6);
    EXPECT_NEAR(w.sum(), 1, 1e-12);
    EXPECT_GE(w.minCoeff(), 0);
    for (int other = 0; other < 2000; ++other) {
      Eigen::VectorXd candidate = testing::RandomMatrix(engine, 6, 1, 1).cwiseAbs2();
      if (other % 2 == 0)
        candidate = candidate.cwiseProduct(
            (testing::RandomMatrix(engine, 6, 1, 1).array() > 0).cast<double>().matrix());
      if (candidate.sum() <= 0) continue;
      candidate /= candidate.sum();
      EXPECT_GE(Value(h, g, candidate), Value(h, g, w) - 1e-9);
    }
  }
}

TEST(FitOnSimplex, RespectsTheLimitAndTheMask) {
  std::mt19937_64 engine(73);
  const Eigen::MatrixXd a = testing::RandomMatrix(engine, 30, 8, 1);
  const Eigen::VectorXd target = a * Eigen::VectorXd::Constant(8, 0.125);
  const Eigen::VectorXd w = FitOnSimplex(a.transpose() * a, a.transpose() * target, 3,
                                         {true, false, true, true, true, false, true, true});
  EXPECT_LE((w.array() > 0).count(), 3);
  EXPECT_EQ(w[1], 0);
  EXPECT_EQ(w[5], 0);
  EXPECT_NEAR(w.sum(), 1, 1e-12);
  EXPECT_THROW(
      FitOnSimplex(Eigen::MatrixXd::Identity(2, 2), Eigen::VectorXd::Zero(2), 1, {false, false}),
      Error);
}

}  // namespace
}  // namespace sole::model
