#include "sim/implicit_foot.h"

#include <random>

#include <gtest/gtest.h>

#include "sim/foot_kinematics.h"
#include "sim/reference_foot.h"
#include "tests/support/jacobian_checker.h"

namespace sole::sim {
namespace {

TEST(ImplicitFoot, GradientIsTheFieldsDerivative) {
  const ImplicitFoot foot(MeanAdultTable());
  const auto& vertices = ReferenceFoot().vertices;
  std::mt19937_64 random(1);
  std::uniform_int_distribution<std::size_t> pick(0, vertices.size() - 1);
  std::normal_distribution<double> off(0, 0.0015);
  for (int i = 0; i < 150; ++i) {
    const Eigen::Vector3d p = vertices[pick(random)] + Eigen::Vector3d(off(random), off(random), off(random));
    const auto field = [&](const Eigen::VectorXd& x) {
      return Eigen::VectorXd::Constant(1, foot.Evaluate(Eigen::Vector3d(x)).value);
    };
    testing_support::ExpectJacobianNear(field, p, foot.Evaluate(p).gradient.transpose(), 5e-3, 1e-8);
  }
}

TEST(ImplicitFoot, ShortlistGivesTheFullField) {
  const ImplicitFoot foot(MeanAdultTable());
  const auto& vertices = ReferenceFoot().vertices;
  ImplicitFoot::Shortlist shortlist;
  for (std::size_t v = 0; v < vertices.size(); v += 97) {
    foot.MakeShortlist(vertices[v], 0.004, shortlist);
    EXPECT_LT(shortlist.size(), foot.Table().primitives.size());
    const Eigen::Vector3d near = vertices[v] + Eigen::Vector3d(0.001, -0.002, 0.0015);
    EXPECT_NEAR(foot.Evaluate(near, 0, shortlist).value, foot.Evaluate(near).value, 1e-6) << "vertex " << v;
  }
}

TEST(ImplicitFoot, OverlappingToesStayApart) {
  // Second and third toe turned towards each other by more than their gap.
  const AnatomyTable& mean = MeanAdultTable();
  const ImplicitFoot foot(
      MovedTable(mean, BoneMotions(mean, {{"mtp_2.abduction", -0.12}, {"mtp_3.abduction", 0.12}})));
  int overlapping = 0;
  for (double z = 0.018; z < 0.0245; z += 0.001) {
    for (double x = -0.01; x < 0.015; x += 0.0001) {
      const Eigen::Vector3d p(x, 0.236, z);
      const auto distances = foot.GroupDistances(p);
      if (distances[2] > 0 || distances[3] > 0 || distances[0] < 0.01) continue;
      if (std::abs(distances[2] - distances[3]) > 2e-5) continue;
      ++overlapping;
      EXPECT_GT(foot.Evaluate(p).value, 0) << p.transpose();
    }
  }
  EXPECT_GT(overlapping, 3);
}

TEST(BoneIndex, UnknownBoneIsNamed) { EXPECT_ANY_THROW(BoneIndex(MeanAdultTable(), "femur")); }

}  // namespace
}  // namespace sole::sim
