#include "app/fit_labels.h"

#include <gtest/gtest.h>

#include "app/fit_sequences.h"
#include "app/truth.h"
#include "sim/motion.h"
#include "tests/support/feet.h"

namespace sole::app {
namespace {

/// A standing foot on a thin plate that bends by about half a millimetre, its scan, and what of it truly touches.
struct SaggedFoot {
  testing_support::StandingFoot foot;
  sim::PlateSag sag;
  TakeClouds take;
};

SaggedFoot StandOnAThinPlate(std::uint64_t seed) {
  const sim::Subject subject = sim::DrawSubject(seed);
  sim::MotionOptions options;
  options.motion = "stand";
  options.frames = 1;
  options.seed = seed;
  options.plate = sim::PlateModel{.thickness_m = 0.006};
  const sim::FootMotion motion = sim::MakeMotion(subject, options);
  SaggedFoot scene{{subject.side, {motion.frames[0].foot.foot.vertices_m, motion.triangles}}, motion.frames[0].foot.sag, {}};
  scene.take.clouds = {testing_support::CloudOf(scene.foot, 20000, 3)};
  scene.take.triggers = {1};
  return scene;
}

double F1(const FrameContact& labels, const std::vector<double>& true_gaps_m) {
  int both = 0, either = 0;
  for (std::size_t v = 0; v < true_gaps_m.size(); ++v) {
    if (true_gaps_m[v] > 0.00005 && true_gaps_m[v] < 0.00015) continue;
    const bool touches = true_gaps_m[v] < 0.0001, label = labels.contact[v] != 0;
    both += touches && label;
    either += touches + label;
  }
  return 2.0 * both / std::max(either, 1);
}

TEST(LabelFit, FollowsAPlateThatSags) {
  const ModelPair models = LoadModelPair(SOLE_MODEL_FILE);
  const SaggedFoot scene = StandOnAThinPlate(48);
  const FootFit fitted = FitTakes(std::span(&scene.take, 1), models)[0][0];
  ASSERT_EQ(fitted.fit.frames[0].verdict, "good");
  const model::FootModel& model = scene.foot.side == Side::kRight ? models.right : models.left;
  std::vector<double> gaps;
  double low = 0;
  int touching = 0;
  for (const Eigen::Vector3d& place : MaterialPositions(model, scene.foot.mesh, scene.foot.side)) {
    const double down = scene.sag.At(place.x(), place.y());
    gaps.push_back(place.z() + down);
    if (gaps.back() < 0.0001) low += down, ++touching;
  }
  low /= touching;
  EXPECT_GT(low, 0.0002);  // or it shows nothing
  // The glass where it went down to, its bend as the calibrated surface's residual.
  GroundSurface bent;
  bent.first_node_m = Eigen::Vector2d(-0.2, -0.25);
  bent.spacing_m = 0.01;
  bent.nodes_x = 41, bent.nodes_y = 51;
  for (int j = 0; j < 51; ++j) {
    for (int i = 0; i < 41; ++i) bent.residual_m.push_back(-scene.sag.At(-0.2 + 0.01 * i, -0.25 + 0.01 * j));
  }
  GroundPlane lower;
  lower.offset_m = -low;
  const double local = F1(LabelFit(models, fitted.fit, fitted.clouds, std::vector<GroundPlane>(1), bent)[0], gaps);
  const double plane = F1(LabelFit(models, fitted.fit, fitted.clouds, std::vector{lower})[0], gaps);
  const double unloaded = F1(LabelFit(models, fitted.fit, fitted.clouds, std::vector<GroundPlane>(1))[0], gaps);
  std::printf("  %.2f mm down: F1 %.3f with its bend, %.3f with a lower plane, %.3f with the unloaded plate\n", 1e3 * low, local, plane, unloaded);
  EXPECT_GT(local, 0.93);
  EXPECT_GT(plane, 0.9);
  EXPECT_GT(local, unloaded + 0.02);
}

}  // namespace
}  // namespace sole::app
