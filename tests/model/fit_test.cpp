#include "model/fit.h"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "model/foot_start.h"
#include "model/forward.h"
#include "model/mesh_topology.h"
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
    options.fine_points = 1200;
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

TEST(RegisterFree, ReachesFleshThatIsPressedFlat) {
  // The model's sole lies up to 4 mm under the plate that flattens the scanned one.
  const FootModel& model = ShippedModel();
  ModelParameters known = RestParameters(model);
  const Eigen::MatrixX3d rest = Forward(model, known, Variant::kFine).vertices_m;
  known.translation_m.z() = -0.004 - rest.col(2).minCoeff();
  const TriangleMesh posed = MeshOf(model, Variant::kFine, Forward(model, known, Variant::kFine).vertices_m);
  PointCloud scan = testing_support::SampleMesh(posed, 25000, 2e-5, 5);
  for (std::size_t i = 0; i < scan.Size(); ++i) {
    if (scan.points_m[i].z() > 0) continue;
    scan.points_m[i].z() = 0;
    scan.normals[i] = -Eigen::Vector3f::UnitZ();
  }
  const Registration result = RegisterFree(posed, scan);
  double worst = 0, sum = 0;
  int pressed = 0;
  for (std::size_t v = 0; v < posed.vertices.size(); ++v) {
    if (posed.vertices[v].z() > -0.0005) continue;
    const double height = std::abs(result.vertices_m(static_cast<Eigen::Index>(v), 2));
    worst = std::max(worst, height);
    sum += height;
    ++pressed;
  }
  ASSERT_GT(pressed, 100);
  EXPECT_LT(sum / pressed, 1e-4);
  EXPECT_LT(worst, 1e-3);
  EXPECT_LT(result.residual_m, 1e-4);
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

TEST(ThinForFit, KeepsAnEvenShareOfTheFinitePoints) {
  PointCloud scan;
  for (int i = 0; i < 1000; ++i) {
    scan.points_m.emplace_back(0, 0, i % 10 == 3 ? std::nanf("") : 0.0002f * static_cast<float>(i));
    scan.sigma_m.push_back(static_cast<float>(i));
  }
  const PointCloud thinned = ThinForFit(scan, 100);
  ASSERT_EQ(thinned.Size(), 100u);
  EXPECT_EQ(thinned.points_m.front().z(), 0);
  EXPECT_GT(thinned.points_m.back().z(), 0.195f);
  for (std::size_t i = 0; i < thinned.Size(); ++i)
    EXPECT_EQ(thinned.points_m[i].z(), 0.0002f * thinned.sigma_m[i]);
  EXPECT_EQ(ThinForFit({}, 100).Size(), 0u);
}

/// The foot's scan with a shank above it: the rim drawn out by 100 mm along its plane's normal.
PointCloud ScanWithShank(const FootModel& model, const ModelParameters& parameters) {
  PointCloud scan = ScanOf(model, parameters);
  const TriangleMesh mesh =
      MeshOf(model, Variant::kFine, Forward(model, parameters, Variant::kFine).vertices_m);
  const std::vector<bool> boundary = BoundaryVertices(mesh);
  const RimPlane rim = RimPlaneOf(mesh, boundary);
  for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (!boundary[v]) continue;
    const Eigen::Vector3d outwards = (mesh.vertices[v] - rim.point).normalized();
    for (int i = 1; i <= 50; ++i) {
      scan.points_m.push_back((mesh.vertices[v] + 0.002 * i * rim.normal).cast<float>());
      scan.normals.push_back(outwards.cast<float>());
    }
  }
  return scan;
}

TEST(FitFrames, FollowsAFootThatStridesOutTurnsUpItsToesAndHasAShank) {
  // 0.2 m and 70 degrees of pitch between the frames, as in walking at 5 Hz; then a view of half of it.
  const FootModel& right = ShippedModel();
  const FootModel left = MirrorModel(right);
  std::vector<ModelParameters> known;
  for (const double pitch : {-0.8, 0.4, 0.0}) {
    ModelParameters parameters = KnownFoot(left, 0.2);
    const Eigen::AngleAxisd turn(Eigen::AngleAxisd(0.2, Eigen::Vector3d::UnitZ()) *
                                 Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitX()));
    parameters.theta.row(0) = turn.angle() * turn.axis().transpose();
    parameters.translation_m.y() += 0.2 * static_cast<double>(known.size());
    known.push_back(parameters);
  }
  std::vector<PointCloud> clouds;
  for (const ModelParameters& parameters : known) clouds.push_back(ScanWithShank(left, parameters));
  const Eigen::Vector3d middle = Forward(left, known[2]).vertices_m.colwise().mean();
  PointCloud half;
  for (std::size_t i = 0; i < clouds[2].Size(); ++i) {
    if (clouds[2].points_m[i].x() > middle.x() && clouds[2].points_m[i].z() > middle.z()) continue;
    half.points_m.push_back(clouds[2].points_m[i]);
    half.normals.push_back(clouds[2].normals[i]);
  }
  clouds[2] = half;
  const std::int64_t triggers[] = {1, 2, 3};
  const FitSequence fit = FitFrames(right, left, clouds, triggers);
  for (std::size_t f = 0; f < 3; ++f) {
    EXPECT_EQ(fit.frames[f].side, Side::kLeft);
    EXPECT_EQ(fit.frames[f].verdict, "good") << f;
    const Eigen::MatrixX3d truth = Forward(left, known[f]).vertices_m;
    EXPECT_LT((fit.frames[f].vertices_m - truth).rowwise().norm().mean(), 2e-3) << f;
  }
}

TEST(FitFrames, SomethingElseIsNotAGoodFoot) {
  // A box of a hand's size.
  TriangleMesh box;
  for (int i = 0; i < 8; ++i) box.vertices.emplace_back(0.1 * (i & 1), 0.1 * (i >> 1 & 1), 0.06 * (i >> 2));
  for (const auto& [a, b, c, d] : {std::array{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}) {
    box.triangles.emplace_back(a, b, c);
    box.triangles.emplace_back(a, c, d);
  }
  const PointCloud clouds[] = {testing_support::SampleMesh(box, 5000, 5e-5, 3)};
  const std::int64_t triggers[] = {1};
  const FootModel& right = ShippedModel();
  const FitSequence fit = FitFrames(right, MirrorModel(right), clouds, triggers);
  EXPECT_NE(fit.frames[0].verdict, "good");
}

TEST(FindFootStarts, FindsSideAndHeadingAllRound) {
  const FootModel& right = ShippedModel();
  const FootModel left = MirrorModel(right);
  for (int i = 0; i < 8; ++i) {
    const double heading = -3.0 + 0.8 * i;
    const Side side = i % 2 ? Side::kLeft : Side::kRight;
    const FootModel& model = side == Side::kRight ? right : left;
    const PointCloud scan = ScanWithShank(model, KnownFoot(model, heading));
    const Eigen::VectorXd none = Eigen::VectorXd::Zero(right.NumBetas());
    const std::vector<FootStart> starts = FindFootStarts(right, left, scan, none);
    ASSERT_FALSE(starts.empty());
    EXPECT_EQ(starts[0].side, side) << heading;
    EXPECT_LT(std::abs(std::remainder(starts[0].heading_rad - heading, 2 * M_PI)), 0.15) << heading;
    EXPECT_NEAR(HeadingOf(starts[0].parameters), starts[0].heading_rad, 1e-9);
  }
  PointCloud few;
  few.points_m.assign(49, Eigen::Vector3f::Zero());
  EXPECT_TRUE(FindFootStarts(right, left, few, Eigen::VectorXd::Zero(right.NumBetas())).empty());
}

}  // namespace
}  // namespace sole::model
