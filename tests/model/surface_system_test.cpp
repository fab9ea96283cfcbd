#include "model/surface_system_internal.h"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <random>

#include "model/surface_topology.h"
#include "tests/support/meshes.h"

namespace sole::model {
namespace {

TEST(TopologyOf, NamesTheEdgesOfEveryTriangle) {
  const TriangleMesh mesh = testing_support::Ellipsoid({1, 1, 1}, 6, 8);
  const SurfaceTopology topology = TopologyOf(mesh);
  ASSERT_EQ(topology.triangle_edges.size(), mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const auto [a, b] = topology.edges.at(static_cast<std::size_t>(topology.triangle_edges[t][k]));
      EXPECT_EQ(std::minmax(mesh.triangles[t][k], mesh.triangles[t][(k + 1) % 3]), std::minmax(a, b));
    }
  }
}

TEST(Solve, AgreesWithADenseFactorisation) {
  // A weak anchor, as where a scan shows nothing: the system is badly conditioned.
  const TriangleMesh mesh = testing_support::Ellipsoid({1, 1, 1}, 8, 9);
  const SurfaceTopology topology = TopologyOf(mesh);
  const auto n = static_cast<Eigen::Index>(mesh.vertices.size());
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  BlockSystem system{topology.edges, std::vector<Eigen::Matrix3d>(mesh.vertices.size(), 1e-3 * Eigen::Matrix3d::Identity()),
                     {}, Eigen::Matrix3Xd::NullaryExpr(3, n, [&] { return normal(random); })};
  Eigen::MatrixXd dense = 1e-3 * Eigen::MatrixXd::Identity(3 * n, 3 * n);
  for (const auto& [a, b] : topology.edges) {
    // Energy |u^T (x_a + s x_b)|^2 + |x_a - x_b|^2.
    const Eigen::Vector3d u(normal(random), normal(random), normal(random));
    const double s = normal(random);
    const Eigen::Matrix3d form = u * u.transpose(), one = Eigen::Matrix3d::Identity();
    system.diagonal[static_cast<std::size_t>(a)] += form + one;
    system.diagonal[static_cast<std::size_t>(b)] += s * s * form + one;
    system.coupling.push_back(s * form - one);
    dense.block<3, 3>(3 * a, 3 * a) += form + one;
    dense.block<3, 3>(3 * b, 3 * b) += s * s * form + one;
    dense.block<3, 3>(3 * a, 3 * b) += s * form - one;
    dense.block<3, 3>(3 * b, 3 * a) += s * form - one;
  }
  const Eigen::VectorXd expected = dense.ldlt().solve(system.right.reshaped());
  const Eigen::Matrix3Xd found = Solve(system, Eigen::Matrix3Xd::Zero(3, n), 1e-10, 2000);
  EXPECT_LT((found.reshaped() - expected).norm(), 1e-6 * expected.norm());
  // From the solution no step is taken.
  EXPECT_EQ(Solve(system, found, 1e-9, 2000), found);
}

}  // namespace
}  // namespace sole::model
