// Sparse correctives from sums over samples, distances along a mesh.
#include "model/train_correctives.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "random_model.h"

namespace sole::model {
namespace {

using testing::RandomMatrix;

/// A strip of `n` squares of 10 mm, cut into triangles.
TriangleMesh Strip(int n) {
  TriangleMesh mesh;
  for (int i = 0; i <= n; ++i) {
    mesh.vertices.emplace_back(0.01 * i, 0, 0);
    mesh.vertices.emplace_back(0.01 * i, 0.01, 0);
  }
  for (int i = 0; i < n; ++i) {
    mesh.triangles.emplace_back(2 * i, 2 * i + 2, 2 * i + 1);
    mesh.triangles.emplace_back(2 * i + 1, 2 * i + 2, 2 * i + 3);
  }
  return mesh;
}

TEST(EdgeDistances, GoAlongTheEdgesFromTheNearestSource) {
  const TriangleMesh mesh = Strip(10);
  const Eigen::VectorXd from_one = EdgeDistances(mesh, std::vector<int>{0});
  EXPECT_NEAR(from_one[20], 0.10, 1e-12);
  EXPECT_NEAR(from_one[1], 0.01, 1e-12);
  // Over the diagonals of the squares, which lead back towards the start: down first, then along.
  EXPECT_NEAR(from_one[21], 0.11, 1e-12);
  const Eigen::VectorXd from_both = EdgeDistances(mesh, std::vector<int>{0, 20});
  EXPECT_NEAR(from_both[10], 0.05, 1e-12);
  TriangleMesh apart = Strip(2);
  const auto lonely = static_cast<int>(apart.vertices.size());
  apart.vertices.emplace_back(1, 1, 1);
  EXPECT_TRUE(std::isinf(EdgeDistances(apart, std::vector<int>{0})[lonely]));
}

/// 3 joints; joint 1 truly moves vertices 0 and 1, joint 2 vertex 3; the rest is noise.
struct Known {
  Eigen::MatrixXd posedirs = Eigen::MatrixXd::Zero(3 * 6, 4 * 3);
  Eigen::MatrixXd distances = Eigen::MatrixXd::Constant(6, 3, 0.01);
  CorrectiveEvidence evidence;

  explicit Known(const CorrectiveOptions& options, double noise_m) {
    std::mt19937_64 engine(4);
    posedirs.block<6, 4>(0, 4) = RandomMatrix(engine, 6, 4, 0.01);
    posedirs.block<3, 4>(9, 8) = RandomMatrix(engine, 3, 4, 0.01);
    distances(5, 2) = 0.2;  // out of reach
    evidence = NoCorrectiveEvidence(distances, options);
    for (int s = 0; s < 200; ++s) {
      const Eigen::VectorXd features = RandomMatrix(engine, 12, 1, 0.2);
      const Eigen::VectorXd stacked = posedirs * features + RandomMatrix(engine, 18, 1, noise_m);
      AddEvidence(Eigen::Map<const Eigen::Matrix3Xd>(stacked.data(), 3, 6).transpose(), features,
                  Eigen::VectorXd::Constant(6, 0.5 + 0.5 * (s % 2)), evidence);
    }
  }
};

TEST(SolveCorrectives, FindTheJointsThatMoveAVertexAndHowMuch) {
  CorrectiveOptions options{.sparsity = 0.03, .ridge = 1e-9};
  const Known known(options, 2e-5);
  const Correctives found = SolveCorrectives(known.evidence, known.distances, 6, options);
  EXPECT_LT((found.posedirs - known.posedirs).cwiseAbs().maxCoeff(), 1e-4);
  for (Eigen::Index i = 0; i < 6; ++i) {
    for (Eigen::Index j = 0; j < 3; ++j) {
      const bool moves = (j == 1 && i < 2) || (j == 2 && i == 3);
      EXPECT_EQ(found.activations(i, j) > 0, moves) << i << " " << j;
      EXPECT_EQ(found.posedirs.block(3 * i, 4 * j, 3, 4).isZero(0), !moves);
    }
  }
  EXPECT_DOUBLE_EQ(found.activations.col(1).maxCoeff(), 1);
  EXPECT_NEAR(found.share, 3.0 / 18, 1e-12);
}

TEST(SolveCorrectives, KeepWithinTheirReachAndShare) {
  CorrectiveOptions options{.max_share = 0.2, .sparsity = 1e-9};
  const Known known(options, 1e-3);
  const Correctives found = SolveCorrectives(known.evidence, known.distances, 6, options);
  EXPECT_LE(found.share, 0.2);
  EXPECT_GT(found.sparsity, options.sparsity);
  EXPECT_GT(found.activations(0, 1), 0);  // what is left is what moves most
  options.max_share = 1;
  const Correctives all = SolveCorrectives(known.evidence, known.distances, 6, options);
  EXPECT_TRUE((all.posedirs.block<3, 4>(15, 8).array() == 0).all());  // out of reach
  EXPECT_FALSE((all.posedirs.block<3, 4>(15, 4).array() == 0).all());
  EXPECT_TRUE((all.posedirs.leftCols(4).array() == 0).all());  // the root corrects nothing
}

TEST(RingDistances, AreZeroWhereAJointsWeightsCross) {
  FootModel foot = testing::RandomModel(Family::kSupr, 3);
  foot.parents = {-1, 0, 1, 2, 3};
  const TriangleMesh mesh = Strip(9);
  foot.fine.template_m.resize(20, 3);
  foot.fine.triangles.resize(18, 3);
  for (Eigen::Index i = 0; i < 20; ++i)
    foot.fine.template_m.row(i) = mesh.vertices[static_cast<std::size_t>(i)];
  for (Eigen::Index t = 0; t < 18; ++t)
    foot.fine.triangles.row(t) = mesh.triangles[static_cast<std::size_t>(t)];
  foot.fine.weights.setZero();
  // Joint 1 takes over at 40 mm, what hangs on it (joint 2) at 70 mm.
  for (Eigen::Index i = 0; i < 20; ++i) {
    const Eigen::Index along = i / 2;
    foot.fine.weights(i, along < 4 ? 0 : (along < 7 ? 1 : 2)) = 1;
    if (along == 4) foot.fine.weights.row(i) << 0.5, 0.5, 0, 0, 0;
    if (along == 7) foot.fine.weights.row(i) << 0, 0.5, 0.5, 0, 0;
  }
  const Eigen::MatrixXd distances = RingDistances(foot);
  EXPECT_EQ(distances(8, 1), 0);
  EXPECT_NEAR(distances(0, 1), 0.04, 1e-12);
  EXPECT_NEAR(distances(18, 1), 0.05, 1e-12);
  EXPECT_EQ(distances(14, 2), 0);
  EXPECT_TRUE(std::isinf(distances(8, 0)));
  EXPECT_TRUE(std::isinf(distances(8, 3)));
}

}  // namespace
}  // namespace sole::model
