// Clouds without images on a flat square, where every figure of the parameters can be counted
// again.
#include "sim/scan_cloud.h"

#include <cmath>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "core/error.h"

namespace sole::sim {
namespace {

constexpr double kSide_m = 0.2;
constexpr double kHeight_m = 0.0305;  // off the cells' borders

/// A square at z = kHeight_m that faces upwards, 20 x 20 squares of two triangles.
TriangleMesh MakeSquare() {
  constexpr int kCells = 20;
  TriangleMesh mesh;
  for (int i = 0; i <= kCells; ++i) {
    for (int j = 0; j <= kCells; ++j)
      mesh.vertices.emplace_back(kSide_m * j / kCells, kSide_m * i / kCells, kHeight_m);
  }
  for (int i = 0; i < kCells; ++i) {
    for (int j = 0; j < kCells; ++j) {
      const int a = i * (kCells + 1) + j, b = a + kCells + 1;
      mesh.triangles.emplace_back(a, a + 1, b + 1);
      mesh.triangles.emplace_back(a, b + 1, b);
    }
  }
  return mesh;
}

SideNoise PlainNoise(double sd_m) {
  SideNoise side;
  side.sd_m.fill(sd_m);
  side.sd_of_edge.fill(1);
  side.sd_of_pairs.fill(1);
  side.components = {{0, 1}};
  side.stated_sigma_m.fill(3e-5);
  for (auto& row : side.completeness) row.fill(1);
  return side;
}

class ScanCloud : public testing::Test {
 protected:
  ScanCloud() {
    noise_.glass = noise_.air = PlainNoise(5e-5);
    views_.assign(mesh_.vertices.size(),
                  {.pair = 3, .pairs = 1, .incidence_rad = 0.35f, .edge_m = 0.0035f});
  }
  PointCloud Make(std::uint64_t seed = 1, std::uint64_t sequence_seed = 1) const {
    return MakeScanCloud(mesh_, views_, noise_, {.seed = seed, .sequence_seed = sequence_seed});
  }
  static std::vector<double> Errors(const PointCloud& cloud) {
    std::vector<double> errors;
    for (const Eigen::Vector3f& p : cloud.points_m)
      errors.push_back(static_cast<double>(p.z()) - kHeight_m);
    return errors;
  }
  static double Mean(const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v;
    return sum / static_cast<double>(values.size());
  }
  static double Rms(const std::vector<double>& values) {
    double sum = 0;
    for (const double v : values) sum += v * v;
    return std::sqrt(sum / static_cast<double>(values.size()));
  }

  TriangleMesh mesh_ = MakeSquare();
  std::vector<ScanView> views_;
  ScanNoise noise_;
};

TEST_F(ScanCloud, HasOnePointPerCellOfTheSeenSurface) {
  const std::vector<ScanPoint> places = SampleSeenSurface(mesh_, views_, 0.001, 5);
  std::set<std::pair<int, int>> cells;
  for (const ScanPoint& place : places) {
    const Eigen::Vector3d p = PositionOf(mesh_, place.at);
    EXPECT_TRUE(cells.emplace(std::floor(p.x() / 0.001), std::floor(p.y() / 0.001)).second);
    EXPECT_EQ(place.view.pair, 3);
    EXPECT_FLOAT_EQ(place.view.incidence_rad, 0.35f);
  }
  EXPECT_NEAR(static_cast<double>(places.size()), 200 * 200, 0.03 * 200 * 200)
      << "a cell may have been missed by all tries: exp(-4)";
  // The half whose corners are not all seen stays empty.
  for (std::size_t v = 0; v < views_.size(); ++v) {
    if (mesh_.vertices[v].x() > 0.101) views_[v] = {};
  }
  for (const ScanPoint& place : SampleSeenSurface(mesh_, views_, 0.001, 5))
    ASSERT_LE(PositionOf(mesh_, place.at).x(), 0.1 + 1e-9);
}

TEST_F(ScanCloud, ErrorsHaveTheAskedSpreadMeanAndStatedSigma) {
  noise_.air.mean_m.fill(2e-5);
  noise_.air.sd_of_edge = {9, 9, 2, 9};
  noise_.air.sd_of_pairs = {0.5, 9, 9};
  const PointCloud cloud = Make();
  std::vector<double> errors = Errors(cloud);
  EXPECT_NEAR(Mean(errors), 2e-5, 1.5e-6);
  for (double& e : errors) e -= 2e-5;
  EXPECT_NEAR(Rms(errors), 5e-5 * 2 * 0.5, 1e-6);
  EXPECT_EQ(cloud.sigma_m.front(), 3e-5f);
  EXPECT_EQ(cloud.pair.front(), 3);
  EXPECT_TRUE(cloud.intensity.empty());
  EXPECT_EQ(cloud.normals.size(), cloud.Size());
}

TEST_F(ScanCloud, PointsThroughTheGlassHaveTheNoiseOfTheGlass) {
  noise_.glass = PlainNoise(1e-4);
  for (std::size_t v = 0; v < views_.size(); ++v)
    views_[v].through_glass = mesh_.vertices[v].x() > 0.101;
  std::vector<double> glass, air;
  for (const Eigen::Vector3f& p : Make().points_m) {
    const double error = static_cast<double>(p.z()) - kHeight_m;
    if (p.x() > 0.11f) glass.push_back(error);
    if (p.x() < 0.09f) air.push_back(error);
  }
  EXPECT_NEAR(Rms(glass), 1e-4, 3e-6);
  EXPECT_NEAR(Rms(air), 5e-5, 2e-6);
}

TEST_F(ScanCloud, CorrelatedErrorsGoTogetherOverTheirLength) {
  noise_.air.components = {{0, 0.3}, {0.005, 0.7}};
  // Mean product of errors at a distance, over several scans: many independent patches.
  std::map<int, std::pair<double, int>> products;
  double variance = 0;
  constexpr int kScans = 4;
  for (std::uint64_t seed = 1; seed <= kScans; ++seed) {
    const PointCloud cloud = Make(seed);
    const std::vector<double> errors = Errors(cloud);
    variance += Rms(errors) * Rms(errors) / kScans;
    for (std::size_t i = 0; i < cloud.Size(); i += 97) {
      for (std::size_t j = 0; j < cloud.Size(); ++j) {
        const double d = static_cast<double>((cloud.points_m[i] - cloud.points_m[j]).norm());
        for (const int mm : {1, 5, 20}) {
          if (i == j || std::abs(d - 1e-3 * mm) > 3e-4) continue;
          products[mm].first += errors[i] * errors[j];
          ++products[mm].second;
        }
      }
    }
  }
  EXPECT_NEAR(variance, 25e-10, 2.5e-10);
  for (const auto& [mm, sum] : products) {
    const double expected = 0.7 * std::exp(-0.5 * (mm / 5.0) * (mm / 5.0));
    EXPECT_NEAR(sum.first / sum.second / variance, expected, 0.06) << mm << " mm";
  }
}

TEST_F(ScanCloud, GapsLeaveTheAskedShareAndHangTogether) {
  for (auto& row : noise_.air.completeness) row.fill(0.7);
  noise_.hole_length_m = 0.003;
  const double full = static_cast<double>(SampleSeenSurface(mesh_, views_, 0.001, 5).size());
  double there = 0;
  constexpr int kScans = 6;
  for (std::uint64_t seed = 1; seed <= kScans; ++seed)
    there += static_cast<double>(Make(seed).Size()) / kScans;
  EXPECT_NEAR(there / full, 0.7, 0.03);
  // Neighbours of a point are there more often than chance has it.
  std::set<std::pair<int, int>> cells;
  for (const Eigen::Vector3f& p : Make().points_m)
    cells.emplace(std::floor(p.x() / 0.001f), std::floor(p.y() / 0.001f));
  double pairs = 0;
  for (const auto& [x, y] : cells) pairs += cells.contains({x + 1, y});
  EXPECT_GT(pairs / static_cast<double>(cells.size()), 0.84);
}

TEST_F(ScanCloud, OutliersAreAsManyAndAsFarAsAsked) {
  noise_.air.outlier_share.fill(0.1);
  noise_.air.outlier_m = 0.002;
  std::vector<double> far;
  const std::vector<double> errors = Errors(Make());
  for (const double e : errors) {
    if (std::abs(e) > 5 * 5e-5) far.push_back(std::abs(e));
  }
  const double beyond = std::exp(-5 * 5e-5 / 0.002);  // of the exponential's outliers
  EXPECT_NEAR(static_cast<double>(far.size()) / static_cast<double>(errors.size()), 0.1 * beyond,
              0.006);
  EXPECT_NEAR(Mean(far), 0.002 + 5 * 5e-5, 1e-4);
}

TEST_F(ScanCloud, APairKeepsItsOffsetDuringASequence) {
  noise_.air = PlainNoise(0);
  noise_.air.pair_bias_m = 1e-4;
  const double first = Mean(Errors(Make(1, 7)));
  EXPECT_NEAR(first, Mean(Errors(Make(2, 7))), 1e-8);
  EXPECT_GT(std::abs(first - Mean(Errors(Make(1, 8)))), 1e-7);
  std::vector<double> offsets;
  for (std::uint64_t sequence = 1; sequence <= 25; ++sequence)
    offsets.push_back(Mean(Errors(Make(1, sequence))));
  EXPECT_NEAR(Rms(offsets), 1e-4, 4e-5);
}

TEST_F(ScanCloud, NormalsAreOffByTheAskedAngle) {
  noise_.air.normal_rad.fill(0.04);
  double squares = 0;
  const PointCloud cloud = Make();
  for (const Eigen::Vector3f& n : cloud.normals) {
    EXPECT_NEAR(n.norm(), 1, 1e-5);
    const double angle = std::acos(std::min(1.0, static_cast<double>(n.z())));
    squares += angle * angle;
  }
  EXPECT_NEAR(std::sqrt(squares / static_cast<double>(cloud.Size())), 0.04 * std::sqrt(2), 0.002);
}

TEST_F(ScanCloud, IsThinnedEvenly) {
  const PointCloud cloud =
      MakeScanCloud(mesh_, views_, noise_, {.seed = 1, .sequence_seed = 1, .max_points = 8000});
  ASSERT_EQ(cloud.Size(), 8000U);
  int left = 0;
  for (const Eigen::Vector3f& p : cloud.points_m) left += p.x() < 0.1f;
  EXPECT_NEAR(left, 4000, 200);
}

TEST_F(ScanCloud, SameSeedSameBits) {
  noise_.air.components = {{0, 0.3}, {0.005, 0.7}};
  EXPECT_EQ(Make(4).points_m, Make(4).points_m);
  EXPECT_NE(Make(4).points_m, Make(5).points_m);
  views_.pop_back();
  EXPECT_THROW(Make(), Error);
}

}  // namespace
}  // namespace sole::sim
