#include "model/surface_query.h"

#include <cmath>
#include <limits>
#include <random>

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "core/error.h"
#include "tests/support/meshes.h"

namespace sole::model {
namespace {

using testing_support::Ellipsoid;

TEST(ClosestBarycentric, BeatsEveryPointOfAFineGrid) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> unit(-1, 1);
  const auto draw = [&] { return Eigen::Vector3d(unit(random), unit(random), unit(random)); };
  for (int trial = 0; trial < 200; ++trial) {
    const Eigen::Vector3d a = draw(), b = draw(), c = draw(), p = 2 * draw();
    const Eigen::Vector3d w = ClosestBarycentric(p, a, b, c);
    EXPECT_NEAR(w.sum(), 1, 1e-12);
    EXPECT_GE(w.minCoeff(), -1e-12);
    const double distance = (w[0] * a + w[1] * b + w[2] * c - p).norm();
    for (int i = 0; i <= 20; ++i) {
      for (int j = 0; i + j <= 20; ++j) {
        const Eigen::Vector3d q = (i * a + j * b + (20 - i - j) * c) / 20;
        EXPECT_LE(distance, (q - p).norm() + 1e-12);
      }
    }
  }
}

TEST(SurfaceQuery, AgreesWithBruteForce) {
  const TriangleMesh mesh = Ellipsoid({0.05, 0.13, 0.04}, 20, 30);
  const SurfaceQuery query(mesh);
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> unit(-0.15, 0.15);
  for (int trial = 0; trial < 300; ++trial) {
    const Eigen::Vector3d p(unit(random), unit(random), unit(random));
    double best = 1e9;
    for (const Eigen::Vector3i& t : mesh.triangles) {
      const auto corner = [&](int k) { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
      const Eigen::Vector3d w = ClosestBarycentric(p, corner(0), corner(1), corner(2));
      best = std::min(best, (w[0] * corner(0) + w[1] * corner(1) + w[2] * corner(2) - p).norm());
    }
    const auto hit = query.Closest(p, 1.0);
    ASSERT_TRUE(hit);
    EXPECT_NEAR(hit->distance_m, best, 1e-9);
    EXPECT_LT((PositionOf(mesh, hit->point) - hit->position).norm(), 1e-12);
    EXPECT_FALSE(query.Closest(p, 0.99 * best));
  }
}

TEST(SurfaceQuery, FollowsItsVertices) {
  TriangleMesh mesh = Ellipsoid({0.05, 0.13, 0.04}, 20, 30);
  SurfaceQuery moved(mesh);
  std::mt19937_64 random(6);
  std::uniform_real_distribution<double> unit(-0.15, 0.15);
  for (const double turn : {0.4, 2.0}) {
    // A turn, a shift and a dent: nothing stays where it was.
    for (Eigen::Vector3d& v : mesh.vertices) {
      v = Eigen::AngleAxisd(turn, Eigen::Vector3d(1, 2, 3).normalized()) * v + Eigen::Vector3d(0.3, 0, -0.1);
      v.y() *= 0.9;
    }
    moved.Move(mesh.vertices);
    const SurfaceQuery made(mesh);
    for (int trial = 0; trial < 100; ++trial) {
      const Eigen::Vector3d p = mesh.vertices[5] + Eigen::Vector3d(unit(random), unit(random), unit(random));
      const auto a = moved.Closest(p, 1.0), b = made.Closest(p, 1.0);
      ASSERT_TRUE(a && b);
      EXPECT_EQ(a->point.triangle, b->point.triangle);
      EXPECT_EQ(a->distance_m, b->distance_m);
    }
  }
  mesh.vertices.pop_back();
  EXPECT_THROW(moved.Move(mesh.vertices), Error);
}

/// Distance along a ray to the nearest triangle, by its three edge planes.
double BruteForceAlong(const TriangleMesh& mesh, const Eigen::Vector3d& origin,
                       const Eigen::Vector3d& direction) {
  double best = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const auto corner = [&](int k) { return mesh.vertices[static_cast<std::size_t>(t[k])]; };
    const Eigen::Vector3d normal = (corner(1) - corner(0)).cross(corner(2) - corner(0));
    const double along = normal.dot(corner(0) - origin) / normal.dot(direction);
    const Eigen::Vector3d p = origin + along * direction;
    bool inside = along >= 0;
    for (int k = 0; k < 3; ++k)
      inside &= normal.dot((corner((k + 1) % 3) - corner(k)).cross(p - corner(k))) >= 0;
    if (inside) best = std::min(best, along);
  }
  return best;
}

TEST(SurfaceQuery, RaysAgreeWithBruteForceFromOutsideAndInside) {
  const TriangleMesh mesh = Ellipsoid({0.05, 0.13, 0.04}, 20, 30);
  const SurfaceQuery query(mesh);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(-1, 1);
  int met = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const double far = trial % 2 == 0 ? 0.3 : 0.02;  // outside, inside
    const Eigen::Vector3d origin = far * Eigen::Vector3d(unit(random), unit(random), unit(random));
    const Eigen::Vector3d aim = 0.04 * Eigen::Vector3d(unit(random), unit(random), unit(random));
    const Eigen::Vector3d direction = (aim - origin).normalized();
    const double wanted = BruteForceAlong(mesh, origin, direction);
    const auto hit = query.FirstAlong(origin, 3 * direction, 1.0);
    ASSERT_EQ(hit.has_value(), std::isfinite(wanted)) << trial;
    if (!hit) continue;
    ++met;
    EXPECT_NEAR(hit->distance_m, wanted, 1e-9) << trial;
    EXPECT_LT((PositionOf(mesh, hit->point) - hit->position).norm(), 1e-12);
    EXPECT_LT((origin + wanted * direction - hit->position).norm(), 1e-9);
    EXPECT_GT(hit->point.barycentric.minCoeff(), -1e-4);
    EXPECT_FALSE(query.FirstAlong(origin, direction, 0.99 * wanted));
  }
  EXPECT_GT(met, 400);
}

TEST(SurfaceQuery, RaysThroughVerticesAndEdgesMeetTheSurface) {
  const TriangleMesh mesh = Ellipsoid({0.05, 0.13, 0.04}, 20, 30);
  const SurfaceQuery query(mesh);
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3d a = mesh.vertices[static_cast<std::size_t>(t[k])];
      const Eigen::Vector3d b = mesh.vertices[static_cast<std::size_t>(t[(k + 1) % 3])];
      for (const double share : {0.0, 0.3}) {
        const Eigen::Vector3d at = (1 - share) * a + share * b;
        const auto hit = query.FirstAlong(2 * at, -at, 1.0);
        ASSERT_TRUE(hit);
        EXPECT_LT((hit->position - at).norm(), 1e-6);
      }
    }
  }
}

TEST(SurfaceQuery, RefusesTrianglesWithoutVertices) {
  TriangleMesh mesh = Ellipsoid({1, 1, 1}, 4, 4);
  mesh.triangles[3][1] = 1000;
  EXPECT_THROW(SurfaceQuery{mesh}, Error);
  EXPECT_THROW(SurfaceQuery{TriangleMesh{}}, Error);
}

TEST(SurfaceQuery, LeavesTheProgramItsThreads) {
  const auto allowed = [] {
    return tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  };
  const std::size_t before = allowed();
  const SurfaceQuery query(Ellipsoid({0.05, 0.1, 0.03}, 20, 30));
  EXPECT_TRUE(query.Closest(Eigen::Vector3d(0.06, 0, 0), 0.1).has_value());
  EXPECT_EQ(allowed(), before);
}

}  // namespace
}  // namespace sole::model
