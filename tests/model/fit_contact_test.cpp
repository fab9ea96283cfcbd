// Fits of a model whose network is told contact.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/error.h"
#include "model/fit.h"
#include "model/forward.h"
#include "model/mirror.h"
#include "model/model_file.h"
#include "tests/support/meshes.h"

namespace sole::model {
namespace {

/// The shipped foot standing on z = 0 with a hand-made network that flattens two regions of the sole, heel and
/// forefoot, each by the mean contact of its vertices, 4 mm deep.
struct PressedFoot {
  FootModel model = LoadModel(SOLE_MODEL_FILE);
  ModelParameters known;
  std::vector<std::uint8_t> region;  ///< N: 0 no sole, 1 heel, 2 forefoot
};

PressedFoot MakePressedFoot() {
  PressedFoot foot;
  FootModel& model = foot.model;
  foot.known = RestParameters(model);
  foot.known.beta.head<2>() << 0.8, -0.5;
  foot.known.theta(0, 2) = 0.3;
  const Eigen::MatrixX3d sole = Forward(model, foot.known).vertices_m;
  const double lowest = sole.col(2).minCoeff(), flat = lowest + 0.004;
  const Eigen::Index n = model.NumVertices(), inputs = 4 * model.NumJoints() + 2;
  NetworkLayer regions{Eigen::MatrixXd::Zero(2, inputs + n), Eigen::VectorXd::Zero(2)};
  NetworkLayer offsets{Eigen::MatrixXd::Zero(3 * n, 2), Eigen::VectorXd::Zero(3 * n)};
  foot.known.contact = Eigen::VectorXd::Zero(n);
  foot.region.assign(static_cast<std::size_t>(n), 0);
  Eigen::Vector2d counts = Eigen::Vector2d::Zero();
  for (Eigen::Index v = 0; v < n; ++v) {
    if (sole(v, 2) > flat) continue;
    const int region = model.coarse.template_m(v, 1) < 0.1 ? 0 : 1;
    foot.region[static_cast<std::size_t>(v)] = static_cast<std::uint8_t>(region + 1);
    regions.weight(region, inputs + v) = 1;
    counts[region] += 1;
    offsets.weight(3 * v + 2, region) = flat - sole(v, 2);
    foot.known.contact[v] = 1;
  }
  regions.weight = counts.cwiseInverse().asDiagonal() * regions.weight;
  model.network = {regions, offsets};
  Prepare(model);
  foot.known.translation_m.z() = -flat;
  return foot;
}

PointCloud ScanOf(const FootModel& model, const ModelParameters& parameters) {
  const TriangleMesh mesh =
      MeshOf(model, Variant::kFine, Forward(model, parameters, Variant::kFine).vertices_m);
  return testing_support::SampleMesh(mesh, 12000, 2e-5, 31);
}

Eigen::VectorXd LabelByHeight(const Eigen::MatrixX3d& vertices_m, const Eigen::VectorXd&,
                              const Eigen::MatrixX3d&, std::size_t) {
  Eigen::VectorXd soft(vertices_m.rows());
  for (Eigen::Index v = 0; v < soft.size(); ++v)
    soft[v] = 0.5 * std::erfc((vertices_m(v, 2) - 1e-4) / 5e-5);
  return soft;
}

FitOptions SmallFit() {
  FitOptions options;
  options.fine_points = 1200;
  options.label_contact = LabelByHeight;
  return options;
}

TEST(FitFrames, FlattensTheSoleThatItFindsInContact) {
  const PressedFoot foot = MakePressedFoot();
  const PointCloud clouds[] = {ScanOf(foot.model, foot.known)};
  const std::int64_t triggers[] = {1};
  const Eigen::MatrixX3d truth = Forward(foot.model, foot.known).vertices_m;
  FootModel plain = foot.model;
  plain.network.clear();
  Prepare(plain);
  const auto fit_with = [&](const FootModel& model) {
    return FitFrames(model, MirrorModel(model), clouds, triggers, SmallFit()).frames[0];
  };
  const FrameFit with = fit_with(foot.model), without = fit_with(plain);
  const auto error = [&](const Eigen::MatrixX3d& vertices) {
    return (vertices - truth).rowwise().norm().mean();
  };
  EXPECT_LT(error(with.vertices_m), 0.5 * error(without.vertices_m));
  EXPECT_LT(error(with.registration_m), error(without.registration_m));
  ASSERT_EQ(with.contact.size(), foot.model.NumVertices());
  EXPECT_EQ(without.contact.size(), 0);
  EXPECT_LT((with.contact - foot.known.contact).cwiseAbs().mean(), 0.03);
}

TEST(FitFrames, LeavesTheNetworkOffInTheAir) {
  const PressedFoot foot = MakePressedFoot();
  ModelParameters lifted = foot.known;
  lifted.contact.setZero();
  lifted.translation_m.z() += 0.03;
  const PointCloud clouds[] = {ScanOf(foot.model, lifted)};
  const std::int64_t triggers[] = {1};
  int asked = 0;
  FitOptions options = SmallFit();
  options.label_contact = [&](const Eigen::MatrixX3d& vertices_m, const Eigen::VectorXd& sd_m,
                              const Eigen::MatrixX3d& undeformed_m, std::size_t frame) {
    ++asked;
    EXPECT_EQ(frame, 0u);
    return LabelByHeight(vertices_m, sd_m, undeformed_m, frame);
  };
  const FrameFit frame =
      FitFrames(foot.model, MirrorModel(foot.model), clouds, triggers, options).frames[0];
  EXPECT_EQ(frame.verdict, "good");
  EXPECT_EQ(frame.contact.size(), 0);
  EXPECT_EQ(asked, 2);  // once for the shape, once for the frame
}

TEST(FitFrames, RefusesLabelsThatAreNotOnePerVertex) {
  const PressedFoot foot = MakePressedFoot();
  const PointCloud clouds[] = {ScanOf(foot.model, foot.known)};
  const std::int64_t triggers[] = {1};
  FitOptions options = SmallFit();
  options.label_contact = [](const Eigen::MatrixX3d&, const Eigen::VectorXd&, const Eigen::MatrixX3d&, std::size_t) {
    return Eigen::VectorXd::Zero(3).eval();
  };
  EXPECT_THROW(FitFrames(foot.model, MirrorModel(foot.model), clouds, triggers, options), Error);
}

}  // namespace
}  // namespace sole::model
