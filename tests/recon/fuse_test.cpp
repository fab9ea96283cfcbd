#include "recon/fuse.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace sole::recon {
namespace {

using Eigen::Vector3d;

/// A dome of foot size (radius 60 mm about (0, 0, top - 60 mm)) sampled every 0.8 mm, seen from
/// above.
void AddDome(std::vector<PairPoint>& points, int pair, double offset_m, double sigma_m,
             double noise_m, std::mt19937_64& engine) {
  std::normal_distribution<double> normal(0, 1);
  for (double x = -0.04; x <= 0.04; x += 0.0008) {
    for (double y = -0.04; y <= 0.04; y += 0.0008) {
      PairPoint p;
      p.point_m = Vector3d(
          x, y,
          std::sqrt(0.06 * 0.06 - x * x - y * y) - 0.02 + offset_m + noise_m * normal(engine));
      p.to_camera = Vector3d::UnitZ();
      p.ray_sigma_m = sigma_m;
      p.intensity = 50;
      p.pair = static_cast<std::uint8_t>(pair);
      points.push_back(p);
    }
  }
}

double DomeError(const Eigen::Vector3f& p) {
  return static_cast<double>((p - Eigen::Vector3f(0, 0, -0.02F)).norm()) - 0.06;
}

PairPoint PointAt(const Vector3d& at) {
  PairPoint p;
  p.point_m = at;
  p.to_camera = Vector3d::UnitZ();
  p.ray_sigma_m = 3e-5;
  p.intensity = 90;
  return p;
}

TEST(Fuse, AveragesByVarianceAndKeepsTheSurface) {
  std::mt19937_64 engine(1);
  std::vector<PairPoint> points;
  AddDome(points, 0, 0.0001, 1e-5, 0, engine);  // 0.1 mm high, but nine times the weight
  AddDome(points, 1, -0.0001, 3e-5, 0, engine);
  const FusedClouds fused = Fuse(points, 2);
  ASSERT_GT(fused.cloud.Size(), 4000U);
  double sum = 0, sigma = 0;
  for (std::size_t i = 0; i < fused.cloud.Size(); ++i) {
    const Eigen::Vector3f p = fused.cloud.points_m[i];
    if (p.head<2>().norm() > 0.01F) continue;  // here "along the ray" is "along the normal"
    sum += DomeError(p) > 0 ? 1 : -1;
    sigma = std::max(sigma, static_cast<double>(fused.cloud.sigma_m[i]));
  }
  EXPECT_GT(sum, 0);
  EXPECT_LE(sigma, 3.1e-5);
  double error = 0;
  for (const Eigen::Vector3f& p : fused.cloud.points_m)
    error = std::max(error, std::abs(DomeError(p)));
  EXPECT_LT(error, 0.00011);
}

TEST(Fuse, SigmaShrinksOnlyAcrossPairs) {
  std::mt19937_64 engine(1);
  std::vector<PairPoint> one, two;
  AddDome(one, 0, 0, 2e-5, 0, engine);
  two = one;
  AddDome(two, 1, 0, 2e-5, 0, engine);
  const FusedClouds single = Fuse(one, 2), both = Fuse(two, 2);
  const auto smallest = [](const FusedClouds& f) {
    return *std::min_element(f.cloud.sigma_m.begin(), f.cloud.sigma_m.end());
  };
  const auto largest = [](const FusedClouds& f) {
    return *std::max_element(f.cloud.sigma_m.begin(), f.cloud.sigma_m.end());
  };
  EXPECT_NEAR(largest(single), 2e-5, 1e-6);
  EXPECT_NEAR(largest(both), 2e-5 / std::sqrt(2.0), 1e-6);
  EXPECT_GT(smallest(single), 5e-6);
  EXPECT_EQ(single.foot_points[1], 0);
}

TEST(Fuse, RemovesOutliersNotTheSurface) {
  std::mt19937_64 engine(2);
  std::vector<PairPoint> points;
  AddDome(points, 0, 0, 3e-5, 3e-5, engine);
  const std::size_t good = Fuse(points, 1).cloud.Size();
  std::uniform_real_distribution<double> u(-0.04, 0.04);
  for (int i = 0; i < 300; ++i)
    points.push_back(PointAt({u(engine), u(engine), 0.09 + 0.5 * u(engine)}));
  for (int i = 0; i < 150; ++i) {  // a clump in the air
    points.push_back(PointAt({0.07 + 0.03 * u(engine), 0.03 * u(engine), 0.06}));
  }
  const FusedClouds fused = Fuse(points, 1);
  int bad = 0;
  for (const Eigen::Vector3f& p : fused.cloud.points_m)
    bad += std::abs(DomeError(p)) > 0.001 ? 1 : 0;
  EXPECT_LE(bad, 2);
  EXPECT_GT(static_cast<double>(fused.cloud.Size()), 0.99 * static_cast<double>(good));
  EXPECT_GT(fused.outliers, 280);
}

TEST(Fuse, NormalsPointToTheCameras) {
  std::mt19937_64 engine(2);
  std::vector<PairPoint> points;
  AddDome(points, 0, 0, 2e-5, 1e-5, engine);
  const FusedClouds fused = Fuse(points, 1);
  double worst = 1;
  for (std::size_t i = 0; i < fused.cloud.Size(); ++i) {
    const Eigen::Vector3f& p = fused.cloud.points_m[i];
    if (p.head<2>().cwiseAbs().maxCoeff() > 0.037F) continue;
    const Eigen::Vector3f truth = (p - Eigen::Vector3f(0, 0, -0.02F)).normalized();
    worst = std::min(worst, static_cast<double>(truth.dot(fused.cloud.normals[i])));
  }
  EXPECT_GT(worst, std::cos(0.1));
}

TEST(Fuse, FlatPiecesOnTheGlassArePlatform) {
  std::mt19937_64 engine(3);
  std::vector<PairPoint> points;
  AddDome(points, 0, 0, 2e-5, 0, engine);
  const std::size_t dome = Fuse(points, 1).cloud.Size();
  std::normal_distribution<double> normal(0, 5e-5);
  for (double x = 0; x < 0.012; x += 0.0008) {
    for (double y = 0; y < 0.012; y += 0.0008) {
      points.push_back(PointAt({0.09 + x, y, normal(engine)}));  // a mark on the glass
      points.push_back(PointAt({-0.105 + x, y, -0.0015}));       // below it: nothing real
    }
  }
  const FusedClouds fused = Fuse(points, 1);
  EXPECT_NEAR(static_cast<double>(fused.cloud.Size()), static_cast<double>(dome),
              0.01 * static_cast<double>(dome));
  EXPECT_GT(fused.platform.Size(), 120U);
  for (const Eigen::Vector3f& p : fused.platform.points_m) {
    EXPECT_GT(p.x(), 0.08F);
    EXPECT_LT(std::abs(p.z()), 0.001F);
  }
  for (const Eigen::Vector3f& p : fused.cloud.points_m) EXPECT_LT(std::abs(p.x()), 0.045F);
}

TEST(Fuse, NothingGivesNothing) {
  const FusedClouds fused = Fuse({}, 3);
  EXPECT_EQ(fused.cloud.Size(), 0U);
  EXPECT_EQ(fused.foot_points, std::vector<int>(3, 0));
}

TEST(Fuse, PairsThatLieApartAreMovedTogetherAndReported) {
  std::mt19937_64 engine(11);
  std::vector<PairPoint> points;
  const double offsets[] = {0.00006, -0.00004, -0.00002};
  for (int pair = 0; pair < 3; ++pair) AddDome(points, pair, offsets[pair], 2e-5, 1e-5, engine);
  const FusedClouds fused = Fuse(points, 4);
  ASSERT_EQ(fused.offset_m.size(), 4U);
  for (std::size_t pair = 0; pair < 3; ++pair) EXPECT_NEAR(fused.offset_m[pair], offsets[pair], 3e-6);
  EXPECT_EQ(fused.offset_m[3], 0);  // it saw nothing
  double squares = 0;
  int count = 0;
  for (const Eigen::Vector3f& p : fused.cloud.points_m) {
    if (p.head<2>().norm() > 0.02F) continue;
    squares += DomeError(p) * DomeError(p);
    ++count;
  }
  EXPECT_LT(std::sqrt(squares / count), 1.5e-5);
}

TEST(Fuse, APairThatIsFarOffIsReportedButNotMoved) {
  std::mt19937_64 engine(12);
  std::vector<PairPoint> points;
  AddDome(points, 0, 0.0004, 2e-5, 1e-5, engine);
  AddDome(points, 1, -0.0004, 2e-5, 1e-5, engine);
  const FusedClouds fused = Fuse(points, 2);
  EXPECT_NEAR(fused.offset_m[0] - fused.offset_m[1], 0.0008, 2e-4);  // points share few voxels
  double nearest = 1;
  for (const Eigen::Vector3f& p : fused.cloud.points_m) {
    if (p.head<2>().norm() < 0.01F) nearest = std::min(nearest, std::abs(DomeError(p)));
  }
  EXPECT_GT(nearest, 0.0002);
}

TEST(Fuse, TwoFeetAreTwoPieces) {
  std::mt19937_64 engine(13);
  std::vector<PairPoint> points;
  AddDome(points, 0, 0, 2e-5, 0, engine);
  const std::size_t first = points.size();
  AddDome(points, 0, 0, 2e-5, 0, engine);
  for (std::size_t i = first; i < points.size(); ++i) points[i].point_m.x() += 0.1;
  // The second is smaller.
  std::erase_if(points, [](const PairPoint& p) { return p.point_m.x() > 0.12; });
  const FusedClouds fused = Fuse(points, 1);
  ASSERT_EQ(fused.pieces.size(), 2U);
  ASSERT_EQ(fused.piece.size(), fused.cloud.Size());
  EXPECT_GT(fused.pieces[0].points, fused.pieces[1].points);
  int counted[2] = {0, 0};
  for (std::size_t i = 0; i < fused.cloud.Size(); ++i) {
    EXPECT_EQ(fused.piece[i], fused.cloud.points_m[i].x() > 0.05F ? 1 : 0);
    ++counted[fused.piece[i]];
  }
  for (std::size_t k = 0; k < 2; ++k) EXPECT_EQ(counted[k], fused.pieces[k].points);
  EXPECT_NEAR(fused.pieces[1].min_m.x(), 0.06, 0.002);
  EXPECT_NEAR(fused.pieces[1].max_m.x(), 0.12, 0.002);
}

}  // namespace
}  // namespace sole::recon
