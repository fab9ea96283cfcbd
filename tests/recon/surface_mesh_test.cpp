#include "recon/surface_mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <utility>

#include "core/error.h"

namespace sole::recon {
namespace {

constexpr double kRadius = 0.02;

/// Points of a sphere about (0.01, 0.02, 0.05), about 0.7 mm apart, above `lowest` times its radius.
PointCloud Sphere(double lowest) {
  constexpr int kPoints = 10000;
  PointCloud cloud;
  for (int i = 0; i < kPoints; ++i) {
    const double z = 1 - 2 * (i + 0.5) / kPoints, angle = 2.399963 * i;
    if (z < lowest) continue;
    const double r = std::sqrt(1 - z * z);
    const Eigen::Vector3d n(r * std::cos(angle), r * std::sin(angle), z);
    cloud.points_m.emplace_back((Eigen::Vector3d(0.01, 0.02, 0.05) + kRadius * n).cast<float>());
    cloud.normals.emplace_back(n.cast<float>());
  }
  return cloud;
}

double DistanceToSphere(const Eigen::Vector3d& p) {
  return std::abs((p - Eigen::Vector3d(0.01, 0.02, 0.05)).norm() - kRadius);
}

/// Edges that do not belong to two triangles of opposite sense.
int OpenEdges(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, int> count;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      const int a = t[k], b = t[(k + 1) % 3];
      count[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
    }
  }
  int open = 0;
  for (const auto& [edge, sum] : count) open += sum != 0;
  return open;
}

double Volume(const TriangleMesh& mesh) {
  double volume = 0;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const auto at = [&](int k) { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
    volume += at(0).dot(at(1).cross(at(2))) / 6;
  }
  return volume;
}

TEST(MeshFromCloud, ClosesASphereAndFacesOutwards) {
  const TriangleMesh mesh = MeshFromCloud(Sphere(-1), {.depth = 6});
  ASSERT_GT(mesh.triangles.size(), 2000U);
  EXPECT_EQ(OpenEdges(mesh), 0);
  EXPECT_NEAR(Volume(mesh) / (4.0 / 3.0 * std::numbers::pi * std::pow(kRadius, 3)), 1, 0.01);
  double sum = 0;
  for (const Eigen::Vector3d& v : mesh.vertices) sum += DistanceToSphere(v);
  EXPECT_LT(sum / static_cast<double>(mesh.vertices.size()), 0.00003);
}

TEST(MeshFromCloud, TrimsWhatNoPointSupports) {
  const PointCloud half = Sphere(0);
  const TriangleMesh trimmed = MeshFromCloud(half, {.depth = 6, .trim_m = 0.002});
  EXPECT_GT(OpenEdges(trimmed), 20);
  for (const Eigen::Vector3d& v : trimmed.vertices) {
    EXPECT_GT(v.z(), 0.05 - 0.0021);
    EXPECT_LT(DistanceToSphere(v), 0.001);
  }
  const TriangleMesh closed = MeshFromCloud(half, {.depth = 6, .trim_m = 0});
  EXPECT_EQ(OpenEdges(closed), 0);
  EXPECT_GT(closed.triangles.size(), trimmed.triangles.size());
}

TEST(MeshFromCloud, RefusesCloudsWithoutNormalsAndLeavesEmptyOnesEmpty) {
  PointCloud bare = Sphere(0);
  bare.normals.clear();
  EXPECT_THROW(MeshFromCloud(bare), Error);
  EXPECT_TRUE(MeshFromCloud({}).triangles.empty());
  EXPECT_THROW(MeshFromCloud(Sphere(0), {.depth = 13}), Error);
}

}  // namespace
}  // namespace sole::recon
