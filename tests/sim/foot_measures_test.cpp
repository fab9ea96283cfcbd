#include "sim/foot_measures.h"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "sim/reference_foot.h"

namespace sole::sim {
namespace {

TEST(MeasureFoot, ScalesWithTheFoot) {
  std::vector<Eigen::Vector3d> vertices = ReferenceFoot().vertices;
  const auto once = MeasureFoot(vertices, Side::kRight);
  for (Eigen::Vector3d& v : vertices) v *= 1.1;
  for (const auto& [name, value] : MeasureFoot(vertices, Side::kRight)) {
    EXPECT_NEAR(value, 1.1 * once.at(name), 0.012 * std::abs(value)) << name;
  }
}

TEST(MeasureFoot, MirroredAndMovedFootMeasuresTheSame) {
  std::vector<Eigen::Vector3d> vertices = ReferenceFoot().vertices;
  const auto right = MeasureFoot(vertices, Side::kRight);
  for (Eigen::Vector3d& v : vertices) v = Eigen::Vector3d(-v.x(), v.y() - 0.13, v.z());
  for (const auto& [name, value] : MeasureFoot(vertices, Side::kLeft)) {
    EXPECT_NEAR(value, right.at(name), 0.05) << name;
  }
}

TEST(MeasureFoot, WideShankDoesNotPassForTheMalleoli) {
  // Above its malleoli the shank is made wider than they are.
  std::vector<Eigen::Vector3d> vertices = ReferenceFoot().vertices;
  const auto before = MeasureFoot(vertices, Side::kRight);
  for (Eigen::Vector3d& v : vertices) v.x() *= 1 + 0.5 * std::clamp((v.z() - 0.095) / 0.015, 0.0, 1.0);
  const auto after = MeasureFoot(vertices, Side::kRight);
  EXPECT_NEAR(after.at("lateralmalleolusheight"), before.at("lateralmalleolusheight"), 0.01);
  EXPECT_NEAR(after.at("bimalleolarbreadth"), before.at("bimalleolarbreadth"), 10);
  EXPECT_GT(after.at("anklecircumference"), 1.2 * before.at("anklecircumference"));
}

TEST(MeasureFoot, MeanFootLiesWithinTheSurveysRange) {
  const auto m = MeasureFoot(ReferenceFoot().vertices, Side::kRight);
  EXPECT_NEAR(m.at("footlength"), 260, 1);
  EXPECT_NEAR(m.at("footbreadthhorizontal"), 97, 6);
  EXPECT_NEAR(m.at("balloffootlength"), 192, 5);
  EXPECT_NEAR(m.at("balloffootcircumference"), 241, 12);
  EXPECT_NEAR(m.at("heelbreadth"), 66, 8);
  EXPECT_NEAR(m.at("anklecircumference"), 220, 15);
}

}  // namespace
}  // namespace sole::sim
