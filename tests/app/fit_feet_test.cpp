#include "app/fit_feet.h"

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "app/fit_sequences.h"
#include "app/truth.h"
#include "tests/app/shipped_models.h"
#include "tests/support/feet.h"

namespace sole::app {
namespace {

using testing::HasSubstr;
using testing_support::Append;
using testing_support::CloudOf;
using testing_support::MakeStandingFoot;
using testing_support::StandingFoot;

/// Something as long and wide as a foot, without the cost of one.
PointCloud Slipper(const Eigen::Vector3d& middle, double heading_rad, unsigned seed) {
  PointCloud cloud = testing_support::SampleMesh(testing_support::Ellipsoid({0.045, 0.125, 0.03}, 10, 14), 4000, 0, seed);
  const Eigen::Matrix3f turn = Eigen::AngleAxisf(static_cast<float>(heading_rad), Eigen::Vector3f::UnitZ()).toRotationMatrix();
  for (Eigen::Vector3f& p : cloud.points_m) p = turn * p + middle.cast<float>();
  return cloud;
}

PointCloud Together(const std::vector<PointCloud>& parts) {
  PointCloud all;
  for (const PointCloud& part : parts) Append(part, all);
  return all;
}

std::vector<std::size_t> Sizes(const std::vector<PointCloud>& clouds) {
  std::vector<std::size_t> sizes;
  for (const PointCloud& cloud : clouds) sizes.push_back(cloud.Size());
  return sizes;
}

TEST(SplitFeet, FeetSideBySideAndBehindEachOther) {
  const PointCloud one = Slipper({0, 0, 0.03}, 0.2, 1);
  EXPECT_EQ(Sizes(SplitFeet(Together({one, Slipper({0.13, 0, 0.03}, -0.1, 2)}))), (std::vector<std::size_t>{4000, 4000}));
  EXPECT_EQ(Sizes(SplitFeet(Together({one, Slipper({0, 0.28, 0.03}, 0.2, 2)}))), (std::vector<std::size_t>{4000, 4000}));
  const std::vector<PointCloud> split = SplitFeet(Together({one, Slipper({0.13, 0.05, 0.1}, 0, 2)}));
  ASSERT_EQ(split.size(), 2U);
  EXPECT_EQ(split[0].points_m, one.points_m);
  EXPECT_EQ(split[0].normals, one.normals);
}

TEST(SplitFeet, CutsFeetApartThatNearlyTouchOrDo) {
  for (const double gap : {0.01, 0.002, 0.0}) {
    for (const double turn : {0.0, 0.7, 2.0}) {  // side by side, one ahead
      const Eigen::Rotation2Dd rotation(turn);
      const Eigen::Vector2d beside = rotation * Eigen::Vector2d(0.09 + gap, 0.03);
      const PointCloud one = Slipper({0, 0, 0.03}, turn, 1), other = Slipper({beside.x(), beside.y(), 0.03}, turn, 2);
      const std::vector<PointCloud> split = SplitFeet(Together({one, other}));
      ASSERT_EQ(split.size(), 2U) << gap << " " << turn;
      for (const PointCloud& foot : split) EXPECT_NEAR(static_cast<double>(foot.Size()), 4000, 40) << gap << " " << turn;
    }
  }
}

TEST(SplitFeet, PartsOfOneFootStayTogether) {
  const PointCloud whole = Slipper({0, 0, 0.03}, 0.9, 1);
  // Without the middle; and a back over a sole.
  PointCloud parts, layers = whole;
  for (std::size_t i = 0; i < whole.Size(); ++i) {
    const Eigen::Vector3f& p = whole.points_m[i];
    const float along = -std::sin(0.9F) * p.x() + std::cos(0.9F) * p.y();
    if (std::abs(along) > 0.03F) parts.points_m.push_back(p);
  }
  ASSERT_GT(parts.Size(), 2500U);
  EXPECT_EQ(SplitFeet(parts).size(), 1U);
  for (Eigen::Vector3f& p : layers.points_m) p.z() *= p.z() > 0.03F ? 1.8F : 0.2F;
  EXPECT_EQ(SplitFeet(layers).size(), 1U);
}

TEST(SplitFeet, LeavesACloudOfOneFootAloneWithAllItsSpecks) {
  PointCloud cloud = Slipper({0, 0, 0.03}, 0, 1);
  cloud.points_m[7].setConstant(std::nanf(""));
  cloud.points_m[8].setConstant(1e9F);
  EXPECT_EQ(Sizes(SplitFeet(cloud)), (std::vector<std::size_t>{4000}));
  EXPECT_EQ(Sizes(SplitFeet(PointCloud{})), (std::vector<std::size_t>{0}));
}

TEST(TrackFeet, FollowsAFootThatStandsWhileAnotherPasses) {
  std::vector<PointCloud> clouds;
  for (int f = 0; f < 6; ++f) {
    std::vector<PointCloud> parts{Slipper({0, 0, 0.03}, 0, 1)};
    if (f >= 1 && f <= 4) parts.push_back(Slipper({0.14, -0.45 + 0.3 * (f - 1), 0.06}, 0, 2));
    clouds.push_back(Together(parts));
  }
  const std::vector<FootTrack> tracks = TrackFeet(clouds);
  ASSERT_EQ(tracks.size(), 2U);
  EXPECT_EQ(tracks[0].first, 0U);
  EXPECT_EQ(tracks[0].End(), 6U);
  EXPECT_EQ(tracks[1].first, 1U);
  EXPECT_EQ(tracks[1].End(), 5U);
  for (std::size_t f = 0; f < 6; ++f) EXPECT_EQ(tracks[0].clouds[f].points_m[9], clouds[0].points_m[9]);
  // Gone and back: two tracks.
  clouds[2] = {};
  const std::vector<FootTrack> broken = TrackFeet(clouds);
  EXPECT_EQ(broken.size(), 4U);
}

/// Both feet of one person for two frames, 190 mm apart, a little turned out.
struct TwoFeet {
  StandingFoot right = MakeStandingFoot(41, Side::kRight, {0.095, 0.01}, -0.15);
  StandingFoot left = MakeStandingFoot(41, Side::kLeft, {-0.095, 0}, 0.12);
  TakeClouds take;
  TwoFeet() {
    for (unsigned f = 0; f < 2; ++f) {
      PointCloud cloud = CloudOf(right, 9000, 10 + f);
      Append(CloudOf(left, 12000, 20 + f), cloud);
      take.clouds.push_back(cloud);
      take.triggers.push_back(f + 1);
    }
  }
  double Error_mm(const FrameFit& frame) const {
    const StandingFoot& foot = frame.side == Side::kRight ? right : left;
    const model::FootModel& model = frame.side == Side::kRight ? Models().right : Models().left;
    const std::vector<Eigen::Vector3d> places = MaterialPositions(model, foot.mesh, foot.side);
    double sum = 0;
    for (std::size_t v = 0; v < places.size(); ++v)
      sum += (frame.registration_m.row(static_cast<Eigen::Index>(v)).transpose() - places[v]).norm();
    return 1e3 * sum / static_cast<double>(places.size());
  }
};

TEST(FitTakes, TwoFeetOfOneTakeAreFittedEachWithItsSide) {
  const TwoFeet scene;
  const std::vector<std::vector<FootFit>> fits = FitTakes(std::span(&scene.take, 1), Models());
  ASSERT_EQ(fits.size(), 1U);
  ASSERT_EQ(fits[0].size(), 2U);
  // The left one has more points.
  EXPECT_EQ(fits[0][0].fit.frames[0].side, Side::kLeft);
  EXPECT_EQ(fits[0][1].fit.frames[0].side, Side::kRight);
  for (const FootFit& foot : fits[0]) {
    ASSERT_EQ(foot.fit.frames.size(), 2U);
    for (const FrameFit& frame : foot.fit.frames) {
      EXPECT_EQ(frame.verdict, "good");
      EXPECT_LT(scene.Error_mm(frame), 4);
    }
  }
}

TEST(FitTakes, TakesOfOneSubjectShareTheShape) {
  const StandingFoot foot = MakeStandingFoot(42, Side::kRight, {0, 0}, 0), turned = MakeStandingFoot(42, Side::kRight, {0.05, 0.02}, 2);
  const StandingFoot other = MakeStandingFoot(42, Side::kLeft, {0, 0}, 0);
  const std::vector<TakeClouds> takes{{{CloudOf(foot, 9000, 1)}, {5}}, {{{}, CloudOf(turned, 9000, 2)}, {1, 2}}, {{CloudOf(other, 9000, 3)}, {1}}};
  const std::vector<std::vector<FootFit>> fits = FitTakes(takes, Models());
  ASSERT_EQ(fits.size(), 3U);
  for (const auto& take : fits) ASSERT_EQ(take.size(), 1U);
  EXPECT_EQ(fits[0][0].fit.beta, fits[1][0].fit.beta);
  EXPECT_NE(fits[0][0].fit.beta, fits[2][0].fit.beta);
  EXPECT_EQ(fits[2][0].fit.frames[0].side, Side::kLeft);
  ASSERT_EQ(fits[1][0].fit.frames.size(), 2U);
  EXPECT_EQ(fits[0][0].fit.frames[0].trigger, 5);
  EXPECT_FALSE(fits[1][0].fit.frames[0].found);
  EXPECT_EQ(fits[1][0].fit.frames[1].trigger, 2);
  EXPECT_EQ(fits[1][0].fit.frames[1].verdict, "good");
  EXPECT_EQ(fits[0][0].fit.frames[0].verdict, "good");
}

}  // namespace
}  // namespace sole::app
