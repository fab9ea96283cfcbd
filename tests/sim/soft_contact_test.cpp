#include "sim/soft_contact.h"

#include <numeric>

#include <gtest/gtest.h>

#include "sim/reference_foot.h"
#include "sim/subject_shape.h"

namespace sole::sim {
namespace {

double Volume(const std::vector<Eigen::Vector3d>& v, Side side) {
  double volume = 0;
  for (const Eigen::Vector3i& t : FootTriangles(side)) {
    const Eigen::Vector3d &a = v[static_cast<std::size_t>(t[0])], &b = v[static_cast<std::size_t>(t[1])],
                          &c = v[static_cast<std::size_t>(t[2])];
    volume += a.dot(Eigen::Vector3d(b.y() * c.z() - b.z() * c.y(), b.z() * c.x() - b.x() * c.z(),
                                    b.x() * c.y() - b.y() * c.x())) / 6;
  }
  return volume;
}

TEST(StandOnPlate, ForcesBalanceAndNothingIsBelowThePlate) {
  for (const Side side : {Side::kRight, Side::kLeft}) {
    const Subject mean = MeanSubject(side);
    const double load_n = 0.5 * 9.81 * mean.weight_kg;
    const LoadedFoot stood = StandOnPlate(mean, load_n, 0.45);
    EXPECT_TRUE(stood.balanced);
    EXPECT_NEAR(std::accumulate(stood.load_n.begin(), stood.load_n.end(), 0.0), load_n, 0.01 * load_n);
    double heel = 1, tip = -1;
    for (const Eigen::Vector3d& v : stood.foot.vertices_m) {
      ASSERT_GE(v.z(), 0);
      if (v.z() > 0.06) continue;
      heel = std::min(heel, v.y());
      tip = std::max(tip, v.y());
    }
    EXPECT_NEAR(stood.pressure_centre_m.y(), heel + 0.45 * (tip - heel), 0.012 * (tip - heel));
  }
}

TEST(StandOnPlate, ContactIsTheGapAndCarriesTheLoad) {
  const LoadedFoot stood = StandOnPlate(MeanSubject(), 350);
  for (std::size_t v = 0; v < stood.contact.size(); ++v) {
    ASSERT_EQ(stood.contact[v] == 1, stood.foot.vertices_m[v].z() < 1e-4);
    if (stood.load_n[v] > 0) {
      ASSERT_EQ(stood.contact[v], 1);
      ASSERT_GT(stood.penetration_m[v], 0);
    }
  }
}

TEST(StandOnPlate, HeelBallAndToesTouchButTheMedialArchDoesNot) {
  const LoadedFoot stood = StandOnPlate(MeanSubject(), 370);
  const auto& reference = ReferenceFoot().vertices;
  int heel = 0, ball = 0, hallux = 0, arch = 0;
  for (std::size_t v = 0; v < stood.contact.size(); ++v) {
    if (stood.contact[v] == 0) continue;
    const Eigen::Vector3d& p = reference[v];
    if (p.y() < 0.06) ++heel;
    if (p.y() > 0.15 && p.y() < 0.2) ++ball;
    if (Binding().charts[v] == 1 && p.y() > 0.22) ++hallux;
    if (p.x() < -0.012 && p.y() > 0.085 && p.y() < 0.13) ++arch;
  }
  EXPECT_GT(heel, 300);
  EXPECT_GT(ball, 300);
  EXPECT_GT(hallux, 50);
  EXPECT_EQ(arch, 0);
}

TEST(StandOnPlate, AreaGrowsWithLoadAndTheVolumeStays) {
  const Subject mean = MeanSubject();
  double last_area = 0;
  for (const double share : {0.1, 0.3, 0.5, 0.8}) {
    const double load_n = share * 9.81 * mean.weight_kg;
    const LoadedFoot stood = StandOnPlate(mean, load_n);
    EXPECT_GT(stood.contact_area_m2, last_area);
    last_area = stood.contact_area_m2;
    const double volume = Volume(PoseFoot(mean, LoadedStandingPose(mean, load_n)).vertices_m, mean.side);
    EXPECT_NEAR(Volume(stood.foot.vertices_m, mean.side) / volume, 1, 0.02) << share;
  }
  EXPECT_GT(last_area, 0.006);
  EXPECT_LT(last_area, 0.013);
}

TEST(StandOnPlate, HeelPadShortensAsPeoplesDo) {
  const Subject mean = MeanSubject();
  const LoadedFoot stood = StandOnPlate(mean, 0.5 * 9.81 * mean.weight_kg);
  double heel = 0;
  for (std::size_t v = 0; v < stood.contact.size(); ++v) {
    if (ReferenceFoot().vertices[v].y() < 0.08) heel = std::max(heel, stood.penetration_m[v]);
  }
  EXPECT_GT(heel, 0.0025);
  EXPECT_LT(heel, 0.0042);
}

TEST(PressOnPlate, WithoutLoadNothingTouches) {
  FootPose pose;
  pose.world_from_foot.translation.z() = -0.05;
  const LoadedFoot foot = PressOnPlate(MeanSubject(), pose, {});
  for (std::size_t v = 0; v < foot.contact.size(); ++v) {
    ASSERT_GT(foot.foot.vertices_m[v].z(), 0);
    ASSERT_EQ(foot.contact[v], 0);
  }
}

}  // namespace
}  // namespace sole::sim
