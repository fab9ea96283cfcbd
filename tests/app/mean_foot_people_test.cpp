// Invented people for a model that begins with the mean foot alone.
#include "app/tools/mean_foot_people.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "sim/reference_foot.h"

namespace sole::tools {
namespace {

std::vector<SurfacePoint> SomePoints() {
  std::vector<SurfacePoint> points;
  for (std::size_t t = 0; t < sim::ReferenceFoot().triangles.size(); t += 97)
    points.push_back({static_cast<int>(t), Eigen::Vector3d::Constant(1.0 / 3)});
  return points;
}

TEST(DeformMeanFoot, PeopleDifferAroundTheMeanFootAndKeepTheirJointsInside) {
  const std::vector<SurfacePoint> points = SomePoints();
  const Eigen::MatrixX3d rest = PointsOn(sim::ReferenceFoot().vertices, points);
  const std::vector<Person> people = DeformMeanFoot(points, 200);
  Eigen::MatrixX3d mean = Eigen::MatrixX3d::Zero(rest.rows(), 3);
  double least = 1, most = 0;
  for (const Person& person : people) {
    mean += person.rest_m / static_cast<double>(people.size());
    const double length = person.rest_m.col(1).maxCoeff() - person.rest_m.col(1).minCoeff();
    least = std::min(least, length);
    most = std::max(most, length);
    for (Eigen::Index j = 1; j < person.joints_m.rows(); ++j) {
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_GT(person.joints_m(j, axis), person.rest_m.col(axis).minCoeff());
        EXPECT_LT(person.joints_m(j, axis), person.rest_m.col(axis).maxCoeff());
      }
    }
  }
  const auto centred = [](const Eigen::MatrixX3d& all) {
    return Eigen::MatrixX3d(all.rowwise() - all.colwise().mean());
  };
  EXPECT_LT((centred(mean) - centred(rest)).rowwise().norm().maxCoeff(), 0.004);
  EXPECT_GT(most - least, 0.04);  // of 200 people
  EXPECT_EQ(DeformMeanFoot(points, 3)[2].rest_m, people[2].rest_m);
}

TEST(FourInfluences, KeepsTheLargestAndSumsToOne) {
  Eigen::MatrixXd weights(2, 6);
  weights << 0.3, 0.05, 0.25, 0.2, 0.15, 0.05, 0, 0, 1, 0, 0, 0;
  const Eigen::MatrixXd kept = FourInfluences(weights);
  EXPECT_EQ((kept.row(0).array() > 0).count(), 4);
  EXPECT_EQ(kept(0, 1), 0);
  EXPECT_NEAR(kept(0, 0), 0.3 / 0.9, 1e-12);
  EXPECT_EQ(kept.row(1), weights.row(1));
}

}  // namespace
}  // namespace sole::tools
