#include <gtest/gtest.h>

#include <algorithm>
#include <mutex>
#include <random>
#include <vector>

#include "core/error.h"
#include "recon/nearest_internal.h"

namespace sole::recon {
namespace {

/// A crumpled sheet, a dense knot and a few lonely points.
std::vector<Eigen::Vector3d> MakePoints() {
  std::mt19937_64 engine(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 1500; ++i) {
    const double x = 0.03 * unit(engine), y = 0.03 * unit(engine);
    points.emplace_back(x, y, 0.003 * std::sin(200 * x) + 1e-4 * unit(engine));
  }
  for (int i = 0; i < 200; ++i)
    points.emplace_back(0.05 + 1e-4 * unit(engine), 1e-4 * unit(engine), 1e-4 * unit(engine));
  for (int i = 0; i < 10; ++i)
    points.emplace_back(unit(engine), unit(engine), unit(engine));
  points.push_back(points.front());  // twice the same
  return points;
}

std::vector<int> BruteForce(const std::vector<Eigen::Vector3d>& points, std::size_t i, int k) {
  std::vector<std::pair<double, int>> all;
  for (std::size_t j = 0; j < points.size(); ++j)
    all.emplace_back((points[j] - points[i]).squaredNorm(), static_cast<int>(j));
  std::sort(all.begin(), all.end());
  std::vector<int> nearest;
  for (int n = 0; n < k; ++n) nearest.push_back(all[static_cast<std::size_t>(n)].second);
  std::sort(nearest.begin(), nearest.end());
  return nearest;
}

TEST(ForNearest, EqualsBruteForceForAnySizeOfCell) {
  const std::vector<Eigen::Vector3d> points = MakePoints();
  for (const double cell_m : {0.0005, 0.0025, 0.02}) {
    std::mutex mutex;
    std::vector<std::vector<int>> found(points.size());
    ForNearest(points, 9, cell_m, [&](int i, std::span<const NearPoint> near) {
      std::vector<int> indices;
      for (const NearPoint& n : near) {
        indices.push_back(n.index);
        const Eigen::Vector3d off = points[static_cast<std::size_t>(n.index)] - points[static_cast<std::size_t>(i)];
        EXPECT_EQ(n.squared_m2, off.squaredNorm());
      }
      std::sort(indices.begin(), indices.end());
      const std::lock_guard lock(mutex);
      EXPECT_TRUE(found[static_cast<std::size_t>(i)].empty()) << "called twice for " << i;
      found[static_cast<std::size_t>(i)] = indices;
    });
    for (std::size_t i = 0; i < points.size(); ++i)
      ASSERT_EQ(found[i], BruteForce(points, i, 9)) << i << " cell " << cell_m;
  }
}

TEST(ForNearest, FewerPointsThanAskedForAreAllNear) {
  const std::vector<Eigen::Vector3d> points = {{0, 0, 0}, {1, 0, 0}, {0, 5, 0}};
  std::vector<int> calls(3);
  ForNearest(points, 20, 0.001, [&](int i, std::span<const NearPoint> near) {
    ++calls[static_cast<std::size_t>(i)];
    EXPECT_EQ(near.size(), 3U);
  });
  EXPECT_EQ(calls, std::vector<int>({1, 1, 1}));
  ForNearest({}, 20, 0.001, [](int, std::span<const NearPoint>) { FAIL(); });
  EXPECT_THROW(ForNearest(points, 0, 0.001, {}), Error);
}

}  // namespace
}  // namespace sole::recon
