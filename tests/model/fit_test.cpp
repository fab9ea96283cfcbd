#include "model/fit.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "model/forward.h"
#include "model/mirror.h"
#include "model/model_file.h"
#include "model/surface_cost_internal.h"
#include "tests/support/jacobian_checker.h"
#include "tests/support/meshes.h"

namespace sole::model {
namespace {

const FootModel& ShippedModel() {
  static const FootModel model = LoadModel(SOLE_MODEL_FILE);
  return model;
}

/// A known foot in the air: some shape, some pose, toes `heading_rad` from +y.
ModelParameters KnownFoot(const FootModel& model, double heading_rad) {
  ModelParameters parameters = RestParameters(model);
  parameters.beta[0] = 1.2;
  parameters.beta[1] = -0.8;
  parameters.beta[2] = 0.5;
  parameters.theta.row(0) = Eigen::RowVector3d(0.02, -0.03, heading_rad);
  parameters.theta.row(1) = Eigen::RowVector3d(0.1, 0.0, 0.03);
  parameters.theta(3, 0) = 0.2;
  parameters.translation_m = Eigen::Vector3d(0.01, -0.12, 0.04);
  return parameters;
}

PointCloud ScanOf(const FootModel& model, const ModelParameters& parameters) {
  const TriangleMesh mesh = MeshOf(model, Variant::kFine, Forward(model, parameters, Variant::kFine).vertices_m);
  return testing_support::SampleMesh(mesh, 12000, 5e-5, 21);
}

TEST(FitFrames, FindsSideHeadingPoseAndShape) {
  const FootModel& right = ShippedModel();
  const FootModel left = MirrorModel(right);
  for (const Side side : {Side::kRight, Side::kLeft}) {
    const FootModel& model = side == Side::kRight ? right : left;
    const ModelParameters known = KnownFoot(model, side == Side::kRight ? 0.3 : 2.6);
    const PointCloud clouds[] = {PointCloud{}, ScanOf(model, known)};
    const std::int64_t triggers[] = {7, 8};
    FitOptions options;
    options.fit_points = 1200;
    const FitSequence fit = FitFrames(right, left, clouds, triggers, options);
    ASSERT_EQ(fit.frames.size(), 2u);
    EXPECT_FALSE(fit.frames[0].found);
    EXPECT_EQ(fit.frames[0].verdict, "no foot: 0 scan points");
    const FrameFit& frame = fit.frames[1];
    EXPECT_EQ(frame.trigger, 8);
    EXPECT_EQ(frame.verdict, "good");
    EXPECT_EQ(frame.side, side);
    const Eigen::MatrixX3d truth = Forward(model, known).vertices_m;
    EXPECT_LT((frame.vertices_m - truth).rowwise().norm().mean(), 5e-4);
    EXPECT_LT((frame.registration_m - truth).rowwise().norm().mean(), 5e-4);
    EXPECT_EQ(frame.registration_fine_m.rows(), model.fine.NumVertices());
    EXPECT_LT(frame.residual_m, 1e-4);
  }
}

TEST(FitPose, FleshUnderThePlateIsNotPulledUpByPointsOnIt) {
  // The model stands 3 mm into the plate; its scan is what a rigid plate leaves: lower points at z = 0.
  const FootModel& model = ShippedModel();
  ModelParameters known = RestParameters(model);
  known.translation_m.z() = -0.003 - Forward(model, known, Variant::kFine).vertices_m.col(2).minCoeff();
  PointCloud scan = ScanOf(model, known);
  for (std::size_t i = 0; i < scan.Size(); ++i) {
    if (scan.points_m[i].z() > 0) continue;
    scan.points_m[i].z() = 0;
    scan.normals[i] = -Eigen::Vector3f::UnitZ();
  }
  PoseFitStage stage;
  stage.sigma_m = 0.0003;
  stage.rounds = 3;
  const auto height_error = [&](const PoseFitOptions& options) {
    const PoseFit fit = FitPose(model, scan, known, stage, options);
    return (Forward(model, fit.parameters).vertices_m - Forward(model, known).vertices_m).rowwise().norm().mean();
  };
  PoseFitOptions pulled;
  pulled.glass_height_m = -1;  // off
  const double pushed = height_error({});
  EXPECT_LT(pushed, 1e-4);
  EXPECT_GT(height_error(pulled), 2 * pushed);
}

TEST(SurfaceCost, JacobianAgreesWithDifferences) {
  const FootModel& model = ShippedModel();
  const ModelParameters known = KnownFoot(model, 0.4);
  Correspondences matches;
  for (int i = 0; i < 40; ++i) {
    matches.places.push_back({(i * 197) % static_cast<int>(model.fine.triangles.rows()), {0.2, 0.5, 0.3}});
    matches.targets.push_back(Eigen::Vector3d(0.01, 0.02, 0.03) * i / 40);
    matches.normals.push_back(Eigen::Vector3d(std::sin(i), std::cos(i), 0.3).normalized());
    matches.weights.push_back(1 + 0.1 * i);
  }
  const SurfaceCost cost(model, known, matches);
  const Eigen::Index k = 3 * model.NumJoints(), b = known.beta.size();
  Eigen::VectorXd x(k + b + 3);
  for (Eigen::Index j = 0; j < model.NumJoints(); ++j) x.segment<3>(3 * j) = known.theta.row(j);
  x.segment(k, b) = known.beta;
  x.tail<3>() = known.translation_m;
  const auto evaluate = [&](const Eigen::VectorXd& at, double** jacobians) {
    const double* blocks[] = {at.data(), at.data() + k, at.data() + k + b};
    Eigen::VectorXd residuals(40);
    cost.Evaluate(blocks, residuals.data(), jacobians);
    return residuals;
  };
  RowMatrix theta(40, k), beta(40, b), translation(40, 3);
  double* jacobians[] = {theta.data(), beta.data(), translation.data()};
  evaluate(x, jacobians);
  Eigen::MatrixXd jacobian(40, k + b + 3);
  jacobian << theta, beta, translation;
  testing_support::ExpectJacobianNear([&](const Eigen::VectorXd& at) { return evaluate(at, nullptr); }, x, jacobian);
}

TEST(ThinForFit, KeepsTheFootBelowTheGivenHeight) {
  PointCloud scan;
  for (int i = 0; i < 1000; ++i) scan.points_m.emplace_back(0, 0, 0.0002f * static_cast<float>(i));
  const PointCloud thinned = ThinForFit(scan, 0.1, 100);
  EXPECT_NEAR(static_cast<double>(thinned.Size()), 100, 3);
  for (const Eigen::Vector3f& p : thinned.points_m) EXPECT_LE(p.z(), 0.103f);
  EXPECT_EQ(ThinForFit({}, 0.1, 100).Size(), 0u);
}

}  // namespace
}  // namespace sole::model
