#include "model/separate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "model/forward.h"
#include "random_model.h"

namespace sole::model {
namespace {

using ::testing::ElementsAre;
using testing::RandomModel;
using testing::RandomParameters;

/// The vertices move with the joints `movers` only. Tree: 0 - 1 - {2, 3}, 0 - 4.
FootModel ModelMovedBy(const std::vector<int>& movers, const std::vector<int>& vertices) {
  FootModel model = RandomModel(Family::kSupr, 31);
  for (const int v : vertices) {
    model.coarse.weights.row(v).setZero();
    for (int j = 0; j < 5; ++j) {
      if (std::count(movers.begin(), movers.end(), j)) {
        model.coarse.weights(v, j) = 1.0 / static_cast<double>(movers.size());
      } else {
        model.coarse.posedirs.block(3 * v, 4 * j, 3, 4).setZero();
      }
    }
  }
  Prepare(model);
  return model;
}

TEST(SeparatePart, KeepsTheNearestCommonAncestorAsTheRoot) {
  const std::vector<int> vertices = {2, 3, 5, 9};
  const SeparatedPart part = SeparatePart(ModelMovedBy({2, 3}, vertices), vertices);
  EXPECT_THAT(part.joints, ElementsAre(1, 2, 3));
  EXPECT_THAT(part.model.parents, ElementsAre(-1, 0, 0));
  EXPECT_THAT(part.model.joint_names, ElementsAre("a", "b", "c"));
  const SeparatedPart single = SeparatePart(ModelMovedBy({3}, vertices), vertices);
  EXPECT_THAT(single.joints, ElementsAre(3));
}

TEST(SeparatePart, SkipsJointsInBetween) {
  const std::vector<int> vertices = {9, 2, 3};
  const FootModel model = ModelMovedBy({0, 2}, vertices);
  const SeparatedPart part = SeparatePart(model, vertices);
  EXPECT_THAT(part.joints, ElementsAre(0, 2));
  EXPECT_THAT(part.model.parents, ElementsAre(-1, 0));
  ModelParameters whole = RandomParameters(model, 32);
  whole.contact.resize(0);
  FootModel linear = model;
  linear.network.clear();
  whole.theta.row(1).setZero();
  ModelParameters pose = whole;
  pose.theta = whole.theta({0, 2}, Eigen::all).eval();
  const PosedFoot expected = Forward(linear, whole), foot = Forward(part.model, pose);
  EXPECT_LT((foot.vertices_m - expected.vertices_m(vertices, Eigen::all)).cwiseAbs().maxCoeff(),
            1e-12);
  EXPECT_LT((foot.joints_m - expected.joints_m({0, 2}, Eigen::all)).cwiseAbs().maxCoeff(), 1e-12);
}

TEST(SeparatePart, AnActivationKeepsAJoint) {
  const std::vector<int> vertices = {2, 3};
  FootModel model = ModelMovedBy({0}, vertices);
  model.activations = Eigen::MatrixXd::Zero(12, 5);
  model.activations(3, 4) = 0.1;
  EXPECT_THAT(SeparatePart(model, vertices).joints, ElementsAre(0, 4));
}

TEST(SeparatePart, KeepsWholeTrianglesAndLandmarks) {
  const FootModel model = RandomModel(Family::kStar, 33);  // triangles t, t + 1, t + 2
  const std::vector<int> vertices = {7, 6, 5, 1};
  const SeparatedPart part = SeparatePart(model, vertices);
  ASSERT_EQ(part.model.coarse.triangles.rows(), 1);
  EXPECT_EQ(part.model.coarse.triangles.row(0), Eigen::RowVector3i(2, 1, 0));
  ASSERT_EQ(part.model.landmarks.size(), 1U);
  EXPECT_EQ(part.model.landmarks[0].name, "toe");
  EXPECT_EQ(part.model.landmarks[0].vertex, 0);
}

TEST(SeparatePart, RefusesVerticesThatAreNotThereOrTwice) {
  const FootModel model = RandomModel(Family::kSupr, 34);
  EXPECT_THROW(SeparatePart(model, std::vector<int>{}), Error);
  EXPECT_THROW(SeparatePart(model, std::vector<int>{12}), Error);
  EXPECT_THROW(SeparatePart(model, std::vector<int>{-1}), Error);
  EXPECT_THROW(SeparatePart(model, std::vector<int>{3, 3}), Error);
}

}  // namespace
}  // namespace sole::model
