#include "model/registration.h"

#include <gtest/gtest.h>

#include "model/mesh_topology.h"
#include "tests/support/meshes.h"

namespace sole::model {
namespace {

using testing_support::Ellipsoid;
using testing_support::SampleMesh;

const Eigen::Vector3d kAxes(0.045, 0.12, 0.04);

double EllipsoidValue(const Eigen::Vector3d& p, const Eigen::Vector3d& axes) {
  const Eigen::Vector3d q = p.cwiseQuotient(axes);
  // First-order distance to the ellipsoid's surface.
  return (q.norm() - 1) * q.norm() / q.cwiseQuotient(axes).norm();
}

TEST(RegisterFree, BringsEveryVertexOfAnotherShapeToTheScan) {
  const Eigen::Vector3d swollen = kAxes + Eigen::Vector3d(0.002, -0.001, 0.0015);
  const PointCloud scan = SampleMesh(Ellipsoid(swollen, 120, 160), 40000, 5e-5, 11);
  const TriangleMesh model = Ellipsoid(kAxes, 60, 60);
  const Registration registered = RegisterFree(model, scan);
  double sum = 0;
  for (Eigen::Index v = 0; v < registered.vertices_m.rows(); ++v) {
    const double distance = EllipsoidValue(registered.vertices_m.row(v).transpose(), swollen);
    sum += distance * distance;
    EXPECT_LT(std::abs(distance), 3e-4) << v;
  }
  EXPECT_LT(std::sqrt(sum / static_cast<double>(registered.vertices_m.rows())), 6e-5);
  EXPECT_LT(registered.residual_m, 7e-5);
  EXPECT_GT(registered.matched, 0.99);
}

TEST(RegisterFree, FollowsTheModelWhereTheScanIsMissingAndSaysSo) {
  PointCloud all = SampleMesh(Ellipsoid(kAxes, 120, 160), 30000, 2e-5, 12), scan;
  for (std::size_t i = 0; i < all.Size(); ++i) {
    if (all.points_m[i].y() > 0) continue;  // half the scan is missing
    scan.points_m.push_back(all.points_m[i]);
    scan.normals.push_back(all.normals[i]);
    scan.sigma_m.push_back(all.sigma_m[i]);
  }
  const TriangleMesh model = Ellipsoid(kAxes, 60, 60);
  const Registration registered = RegisterFree(model, scan);
  for (std::size_t v = 0; v < model.vertices.size(); ++v) {
    const auto row = static_cast<Eigen::Index>(v);
    const double moved = (registered.vertices_m.row(row).transpose() - model.vertices[v]).norm();
    EXPECT_LT(moved, 4e-4);
    if (model.vertices[v].y() > 0.03) {
      EXPECT_GT(registered.sd_m[row], 0.002);
    }
    if (model.vertices[v].y() < -0.01) {
      EXPECT_LT(registered.sd_m[row], 3e-4);
    }
  }
}

TEST(RegisterFree, ThinsOnlyEarlyIterations) {
  const Eigen::Vector3d swollen = kAxes + Eigen::Vector3d(0.002, -0.001, 0.0015);
  const PointCloud scan = SampleMesh(Ellipsoid(swollen, 120, 160), 30000, 5e-5, 13);
  const TriangleMesh model = Ellipsoid(kAxes, 60, 60);
  const Registration whole = RegisterFree(model, scan), thinned = RegisterFree(model, scan, {.early_points = 6000});
  // The last iterations see every point: what is left of the scan and what is known of a vertex are the same.
  EXPECT_LT((whole.vertices_m - thinned.vertices_m).rowwise().norm().maxCoeff(), 2e-4);
  EXPECT_EQ(whole.matched, thinned.matched);
  EXPECT_NEAR(whole.residual_m, thinned.residual_m, 1e-6);
  EXPECT_LT(((whole.sd_m - thinned.sd_m).array() / whole.sd_m.array()).abs().maxCoeff(), 0.1);
}

TEST(BoundaryVertices, AreThoseOfTheOpenRim) {
  TriangleMesh mesh = Ellipsoid({1, 1, 1}, 6, 8);
  const std::vector<bool> closed = BoundaryVertices(mesh);
  EXPECT_EQ(std::count(closed.begin(), closed.end(), true), 0);
  std::erase_if(mesh.triangles, [](const Eigen::Vector3i& t) { return t.minCoeff() == 0; });
  const std::vector<bool> boundary = BoundaryVertices(mesh);
  for (std::size_t v = 0; v < boundary.size(); ++v) EXPECT_EQ(boundary[v], v >= 1 && v <= 8) << v;
  EXPECT_EQ(Edges(mesh).size(), 8u * (5 + 4 + 4 + 1));
}

}  // namespace
}  // namespace sole::model
