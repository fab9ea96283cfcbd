#include "sim/reference_foot.h"

#include <algorithm>
#include <map>
#include <set>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "core/error.h"
#include "sim/implicit_foot.h"
#include "sim/reference_codec.h"
#include "sim/subject_shape.h"

namespace sole::sim {
namespace {

TEST(ReferenceFoot, IsOneClosedSurfaceWithoutHandles) {
  const TriangleMesh& mesh = ReferenceFoot();
  EXPECT_GT(mesh.vertices.size(), 30000U);
  EXPECT_LT(mesh.vertices.size(), 60000U);
  std::map<std::pair<int, int>, int> edges;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) ++edges[{t[i], t[(i + 1) % 3]}];
  }
  for (const auto& [edge, count] : edges) {
    ASSERT_EQ(count, 1);
    ASSERT_TRUE(edges.contains({edge.second, edge.first}));
  }
  const int euler = static_cast<int>(mesh.vertices.size()) - static_cast<int>(edges.size() / 2) +
                    static_cast<int>(mesh.triangles.size());
  EXPECT_EQ(euler, 2);
}

TEST(ReferenceFoot, VerticesLieOnTheSkinOrTheCut) {
  const ImplicitFoot foot(MeanAdultTable());
  const ReferenceBinding& binding = Binding();
  const auto& vertices = ReferenceFoot().vertices;
  int off = 0;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    if (binding.kinds[v] != SkinKind::kSkin) {
      EXPECT_NEAR(vertices[v].z(), foot.Table().cut_point.z(), 1e-5);
    }
    if (binding.kinds[v] == SkinKind::kCap) continue;
    const double off_m = std::abs(foot.Evaluate(vertices[v], binding.charts[v]).value);
    if (off_m < 2e-5) continue;
    // Only in the floor of a cleft, where two toes' skins meet, may the label of the toe be in doubt.
    auto toes = foot.GroupDistances(vertices[v]);
    std::sort(toes.begin() + 1, toes.end());
    ASSERT_LT(toes[2], 0.002) << "vertex " << v;
    ++off;
  }
  EXPECT_LT(off, 0.005 * static_cast<double>(vertices.size()));
}

TEST(ReferenceFoot, FacesOutwards) {
  double volume = 0;
  const TriangleMesh& mesh = ReferenceFoot();
  for (const Eigen::Vector3i& t : mesh.triangles) {
    volume += mesh.vertices[static_cast<std::size_t>(t[0])].dot(
                  mesh.vertices[static_cast<std::size_t>(t[1])].cross(mesh.vertices[static_cast<std::size_t>(t[2])])) / 6;
  }
  EXPECT_GT(volume, 0.0009);
  EXPECT_LT(volume, 0.0018);
}

TEST(ReferenceFoot, FiveNailsAndACutAreMarked) {
  std::set<int> toes_with_nails;
  int cut = 0;
  for (std::size_t v = 0; v < FootMaterials().size(); ++v) {
    if (FootMaterials()[v] == FootMaterial::kNail) toes_with_nails.insert(Binding().charts[v]);
    if (FootMaterials()[v] == FootMaterial::kCut) ++cut;
  }
  EXPECT_EQ(toes_with_nails, (std::set<int>{1, 2, 3, 4, 5}));
  EXPECT_GT(cut, 300);
}

TEST(OnSide, LeftTrianglesKeepTheMaterialPoint) {
  const SurfacePoint right{1000, {0.2, 0.3, 0.5}};
  TriangleMesh left = ReferenceFoot();
  for (Eigen::Vector3d& v : left.vertices) v = Mirrored(v);
  left.triangles = FootTriangles(Side::kLeft);
  const Eigen::Vector3d expected = Mirrored(PositionOf(ReferenceFoot(), right));
  EXPECT_LT((PositionOf(left, OnSide(right, Side::kLeft)) - expected).norm(), 1e-12);
}

TEST(ReferenceCodec, RoundTripsWithinHalfAStep) {
  const TriangleMesh mesh{{{0, 0, 0}, {0.1, 0.0123456, 0}, {0, 0.2, -0.01}, {0.03, 0.02, 0.16}},
                          {{0, 2, 1}, {3, 0, 1}, {1, 2, 3}, {0, 3, 2}}};
  const TriangleMesh back = DecodeReference(EncodeReference(mesh));
  ASSERT_EQ(back.vertices.size(), 4U);
  ASSERT_EQ(back.triangles.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_LE((back.vertices[i] - mesh.vertices[i]).cwiseAbs().maxCoeff(), 0.5 * kReferenceStep + 1e-12);
  }
}

TEST(ReferenceCodec, DamageIsAnErrorAndAllocatesNothing) {
  EXPECT_THROW(DecodeReference("SOLEFOOTxxxxxxxxgarbage"), Error);  // claims 48 GB
  const TriangleMesh mesh{{{0, 0, 0}, {0.1, 0, 0}, {0, 0.2, 0}}, {{0, 1, 2}}};
  const std::string file = EncodeReference(mesh);
  EXPECT_THROW(DecodeReference(file.substr(0, file.size() - 3)), Error);
  EXPECT_THROW(DecodeReference(EncodeReference({mesh.vertices, {{0, 1, 7}}})), Error);
}

}  // namespace
}  // namespace sole::sim
