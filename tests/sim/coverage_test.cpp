// Whether the default rig's 10 pairs see a foot from all sides.
#include <algorithm>
#include <cstdio>
#include <utility>

#include <gtest/gtest.h>

#include "sim/reference_foot.h"
#include "sim/renderer.h"
#include "sim/soft_contact.h"
#include "sim/visibility.h"

namespace sole::sim {
namespace {

struct Coverage {
  double foot_by_one = 0, sole_by_two = 0;  ///< shares of the area
};

/// Of the foot without the cut face, standing in the capture volume; the sole is what faces down
/// within 20 mm of the glass.
Coverage Cover(std::uint64_t seed, Side side) {
  const RigConfig config = MakeDefaultRig(20, 1624, 1236);
  const Renderer renderer(config, DrawTrueRig(config, seed), {.seed = seed});
  const Subject subject = DrawSubject(seed, side);
  const LoadedFoot foot = StandOnPlate(subject, 0.5 * 9.81 * subject.weight_kg);
  Scene scene;
  scene.meshes.emplace_back().mesh = {foot.foot.vertices_m, FootTriangles(side)};
  const TriangleMesh& mesh = scene.meshes[0].mesh;
  const auto visible = VisibleToPairs(renderer, renderer.Prepare(scene), 0, config.pairs);
  const std::vector<Eigen::Vector3d> normals = VertexNormals(mesh);
  double area = 0, one = 0, sole = 0, two = 0;
  for (const Eigen::Vector3i& t : mesh.triangles) {
    const auto a = static_cast<std::size_t>(t[0]), b = static_cast<std::size_t>(t[1]),
               c = static_cast<std::size_t>(t[2]);
    if (FootMaterials()[a] == FootMaterial::kCut) continue;
    const Eigen::Vector3d cross =
        (mesh.vertices[b] - mesh.vertices[a]).cross(mesh.vertices[c] - mesh.vertices[a]);
    const auto pairs = std::count_if(visible.begin(), visible.end(), [&](const auto& flags) {
      return flags[a] && flags[b] && flags[c];
    });
    area += cross.norm();
    one += pairs >= 1 ? cross.norm() : 0;
    if (mesh.vertices[a].z() > 0.02 || normals[a].z() > -0.5) continue;
    sole += cross.norm();
    two += pairs >= 2 ? cross.norm() : 0;
  }
  return {one / area, two / sole};
}

TEST(DefaultRig, SeesTheFootWithOnePairAndTheSoleWithTwo) {
  for (const auto& [seed, side] :
       {std::pair{41U, Side::kRight}, {42U, Side::kLeft}, {43U, Side::kRight}}) {
    const Coverage found = Cover(seed, side);
    std::printf("person %u: %.4f of the foot seen by a pair, %.4f of the sole by two\n", seed,
                found.foot_by_one, found.sole_by_two);
    EXPECT_GT(found.foot_by_one, 0.95) << "person " << seed;  // the rest lies between the toes
    EXPECT_GT(found.sole_by_two, 0.95) << "person " << seed;
  }
}

}  // namespace
}  // namespace sole::sim
