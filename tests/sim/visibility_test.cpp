#include "sim/visibility.h"

#include <cmath>
#include <numbers>

#include <gtest/gtest.h>

#include "core/error.h"
#include "tests/sim/test_bodies.h"

namespace sole::sim {
namespace {

const Eigen::Vector3d kCentre(0, 0, 0.05);
constexpr double kRadius = 0.05;

/// Angle between the surface's normal and the straight way to a camera.
double Incidence(const TrueCamera& camera, const Eigen::Vector3d& point) {
  return std::acos((point - kCentre).normalized().dot((camera.Centre() - point).normalized()));
}

TEST(VisibleToPairs, OnAConvexBodyIsAQuestionOfIncidence) {
  const RigConfig config = MakeDefaultRig();
  const Renderer renderer(config, DrawTrueRig(config, 2));
  Scene scene;
  scene.meshes.push_back(MakeSphere(kCentre, kRadius, 60));
  const PreparedScene prepared = renderer.Prepare(scene);
  const auto visible = VisibleToPairs(renderer, prepared, 0, config.pairs);
  ASSERT_EQ(visible.size(), 2U);
  const auto& vertices = scene.meshes[0].mesh.vertices;
  int seen[2] = {0, 0};
  for (std::size_t pair = 0; pair < 2; ++pair) {
    for (std::size_t i = 0; i < vertices.size(); ++i) {
      double worst = 0;
      for (const std::size_t side : {0U, 1U}) {
        worst = std::max(worst, Incidence(renderer.Rig().cameras[2 * pair + side], vertices[i]));
      }
      // Refraction turns the light by less than two degrees here; the edge itself is left open.
      // Both pairs' sides are lit.
      const double degrees = worst * 180 / std::numbers::pi;
      if (degrees < 67) {
        EXPECT_TRUE(visible[pair][i]) << pair << ' ' << vertices[i].transpose();
      } else if (degrees > 73) {
        EXPECT_FALSE(visible[pair][i]) << pair << ' ' << vertices[i].transpose();
      }
      seen[pair] += visible[pair][i];
    }
  }
  EXPECT_GT(seen[0], 500);
  EXPECT_GT(seen[1], 500);
}

TEST(VisibleToPairs, AnOccluderHidesWhatLiesBehindIt) {
  const RigConfig config = MakeDefaultRig();
  const Renderer renderer(config, DrawTrueRig(config, 2));
  Scene scene;
  scene.meshes.push_back(MakeSphere(kCentre, kRadius, 60));
  const auto alone = VisibleToPairs(renderer, renderer.Prepare(scene), 0, config.pairs);
  // A small ball between the sphere and the camera SIM0003 of the second pair.
  const Eigen::Vector3d eye = renderer.Rig().cameras[2].Centre();
  const Eigen::Vector3d target = kCentre + kRadius * (eye - kCentre).normalized();
  scene.meshes.push_back(MakeSphere(target + 0.15 * (eye - target), 0.005, 20));
  const auto behind = VisibleToPairs(renderer, renderer.Prepare(scene), 0, config.pairs);
  int hidden = 0;
  for (std::size_t i = 0; i < alone[1].size(); ++i) {
    const Eigen::Vector3d& vertex = scene.meshes[0].mesh.vertices[i];
    EXPECT_LE(behind[1][i], alone[1][i]);
    EXPECT_EQ(behind[0][i], alone[0][i]) << "the pair below sees the same as before";
    const Eigen::Vector3d way = (eye - vertex).normalized();
    const Eigen::Vector3d to_ball = target + 0.15 * (eye - target) - vertex;
    const double miss = (to_ball - to_ball.dot(way) * way).norm();
    if (alone[1][i] && miss < 0.0045) {
      EXPECT_FALSE(behind[1][i]);
      ++hidden;
    }
  }
  EXPECT_GT(hidden, 5);
}

TEST(VisibleToPairs, NothingIsVisibleInTheDark) {
  RigConfig config = MakeDefaultRig(4, 203, 154);
  config.simulation.projectors.clear();
  const Renderer renderer(config, DrawTrueRig(config, 2));
  Scene scene;
  scene.meshes.push_back(MakeSphere(kCentre, kRadius, 20));
  for (const auto& flags : VisibleToPairs(renderer, renderer.Prepare(scene), 0, config.pairs)) {
    for (const std::uint8_t flag : flags) EXPECT_EQ(flag, 0);
  }
  EXPECT_FALSE(renderer.Render(renderer.Prepare(scene), 2, 1).Empty());  // only room light is left
  scene.exposure = ExposureKind::kTexture;
  EXPECT_THROW(VisibleToPairs(renderer, renderer.Prepare(scene), 0, config.pairs), Error);
}

}  // namespace
}  // namespace sole::sim
