#include "sim/soft_contact.h"

#include <cmath>
#include <numeric>

#include <Eigen/Geometry>
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

LoadedFoot StandOnBendingPlate(const Subject& subject, double load_n) {
  return PressOnPlate(subject, LoadedStandingPose(subject, load_n),
                      {.load_n = load_n, .pressure_centre_y = 0.42, .plate = PlateModel{}});
}

TEST(PressOnPlate, FootStandsOnThePlateThatItsLoadsBend) {
  const Subject mean = MeanSubject();
  const double load_n = 9.81 * mean.weight_kg;
  const LoadedFoot stood = StandOnBendingPlate(mean, load_n), rigid = StandOnPlate(mean, load_n);
  EXPECT_TRUE(stood.balanced);
  EXPECT_NEAR(stood.total_load_n, load_n, 0.01 * load_n);
  EXPECT_GT(stood.sag.At(0, 0), 5e-5);
  EXPECT_LT(stood.sag.At(0, 0), 2e-4);
  std::vector<PlateLoad> loads;
  double bulged_below = 0, apart = 0;
  for (std::size_t v = 0; v < stood.contact.size(); ++v) {
    const Eigen::Vector3d& p = stood.foot.vertices_m[v];
    const double gap = p.z() + stood.sag.At(p.x(), p.y());
    bulged_below = std::min(bulged_below, gap);
    if (std::abs(gap - 1e-4) > 2e-6) {
      EXPECT_EQ(stood.contact[v] == 1, gap < 1e-4) << v;
    }
    if (stood.load_n[v] > 0) loads.push_back({p.x(), p.y(), stood.load_n[v]});
    apart = std::max(apart, (p - rigid.foot.vertices_m[v]).norm());
  }
  EXPECT_GT(bulged_below, -1e-12);
  // The sag is what the foot's own loads make of the plate: the fixed point was reached.
  const PlateSag again = BendPlate({}, loads);
  for (const double y : {-0.1, 0.0, 0.1}) EXPECT_NEAR(again.At(0, y), stood.sag.At(0, y), 1e-6);
  EXPECT_GT(apart, 5e-5);
  EXPECT_LT(apart, 3e-4);
  EXPECT_NEAR(Volume(stood.foot.vertices_m, mean.side) / Volume(rigid.foot.vertices_m, mean.side), 1, 0.001);
}

TEST(PressOnPlate, HeadingTurnsTheWholeSolution) {
  const Subject mean = MeanSubject();
  const ContactOptions options{.load_n = 400, .pressure_centre_y = 0.5};
  FootPose pose = LoadedStandingPose(mean, 400);
  const LoadedFoot ahead = PressOnPlate(mean, pose, options);
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(2.1, Eigen::Vector3d::UnitZ()));
  const Rigid3 moved{turn, {0.07, -0.02, 0}};
  pose.world_from_foot = moved * pose.world_from_foot;
  const LoadedFoot turned = PressOnPlate(mean, pose, options);
  EXPECT_TRUE(turned.balanced);
  double apart = 0;
  for (std::size_t v = 0; v < ahead.contact.size(); v += 7) {
    apart = std::max(apart, (moved * ahead.foot.vertices_m[v] - turned.foot.vertices_m[v]).norm());
  }
  EXPECT_LT(apart, 5e-6);
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
