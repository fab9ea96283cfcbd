#include "model/jacobian.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "core/error.h"
#include "random_model.h"
#include "tests/support/jacobian_checker.h"

namespace sole::model {
namespace {

using testing::RandomModel;
using testing::RandomParameters;

Eigen::VectorXd Pack(const ModelParameters& p) {
  const Eigen::Matrix3Xd theta = p.theta.transpose();
  Eigen::VectorXd x(theta.size() + p.beta.size() + 3);
  x << Eigen::Map<const Eigen::VectorXd>(theta.data(), theta.size()), p.beta, p.translation_m;
  return x;
}

ModelParameters Unpack(ModelParameters p, const Eigen::VectorXd& x) {
  const Eigen::Index turns = p.theta.size(), betas = p.beta.size();
  p.theta = Eigen::Map<const Eigen::Matrix3Xd>(x.data(), 3, turns / 3).transpose();
  p.beta = x.segment(turns, betas);
  p.translation_m = x.tail<3>();
  return p;
}

Eigen::VectorXd Stack(const Eigen::MatrixX3d& points) {
  const Eigen::Matrix3Xd transposed = points.transpose();
  return Eigen::Map<const Eigen::VectorXd>(transposed.data(), transposed.size());
}

void ExpectVertexJacobian(const FootModel& model, const ModelParameters& parameters,
                          Variant variant) {
  const PointsJacobian result = VertexJacobian(model, parameters, variant);
  EXPECT_LT(
      (result.points_m - Forward(model, parameters, variant).vertices_m).cwiseAbs().maxCoeff(),
      1e-13);
  const auto f = [&](const Eigen::VectorXd& x) {
    return Stack(Forward(model, Unpack(parameters, x), variant).vertices_m);
  };
  testing_support::ExpectJacobianNear(f, Pack(parameters), result.jacobian, 2e-9);
}

TEST(VertexJacobian, MatchesNumericDerivativesForEveryFamilyAndVariant) {
  for (const Family family : {Family::kSupr, Family::kStar, Family::kSmpl}) {
    for (const bool affine : {false, true}) {
      const FootModel model = RandomModel(family, 21, affine);
      ExpectVertexJacobian(model, RandomParameters(model, 22), Variant::kCoarse);
      ExpectVertexJacobian(model, RandomParameters(model, 23), Variant::kFine);
    }
  }
}

/// Values as a file of single precision holds them.
FootModel InSingle(FootModel model) {
  const auto round = [](Eigen::MatrixXd& values) {
    values = values.cast<float>().cast<double>().eval();
  };
  for (ModelSurface* surface : {&model.coarse, &model.fine}) {
    round(surface->shapedirs);
    round(surface->posedirs);
  }
  for (NetworkLayer& layer : model.network) round(layer.weight);
  Prepare(model);
  return model;
}

TEST(SinglePrecision, IsReadWhereExactAndChangesNothing) {
  for (const Family family : {Family::kSupr, Family::kStar, Family::kSmpl}) {
    const FootModel model = InSingle(RandomModel(family, 25));
    FootModel full = model;
    full.derived.coarse_single = full.derived.fine_single = {};
    full.derived.network_single.clear();
    ASSERT_GT(model.derived.fine_single.posedirs.size(), 0);
    ASSERT_GT(model.derived.network_single[1].size(), 0);
    EXPECT_EQ(RandomModel(family, 25).derived.network_single[1].size(), 0);
    const ModelParameters parameters = RandomParameters(model, 26);
    const auto largest = [](const Eigen::MatrixXd& difference) {
      return difference.cwiseAbs().maxCoeff();
    };
    for (const Variant variant : {Variant::kCoarse, Variant::kFine}) {
      EXPECT_LT(largest(Forward(model, parameters, variant).vertices_m -
                        Forward(full, parameters, variant).vertices_m),
                1e-15);
      EXPECT_LT(largest(VertexJacobian(model, parameters, variant).jacobian -
                        VertexJacobian(full, parameters, variant).jacobian),
                1e-14);
      EXPECT_LT(largest(VertexContactJacobian(model, parameters, variant) -
                        VertexContactJacobian(full, parameters, variant)),
                1e-14);
    }
    ExpectVertexJacobian(model, parameters, Variant::kFine);
  }
}

TEST(VertexJacobian, OfSomeVerticesIsTheirPartOfTheWhole) {
  for (const bool single : {false, true}) {
    FootModel model = RandomModel(Family::kSupr, 27);
    model.fine.posedirs.block(9, 4, 6, 4).setZero();  // joint 1 corrects neither vertex 3 nor 4
    Prepare(model);
    if (single) model = InSingle(model);
    const ModelParameters parameters = RandomParameters(model, 28);
    const PointsJacobian whole = VertexJacobian(model, parameters, Variant::kFine);
    const std::vector<int> some = {19, 0, 3, 4, 5, 4, 18, 19};
    const PointsJacobian part = VertexJacobian(model, parameters, Variant::kFine, some);
    for (std::size_t m = 0; m < some.size(); ++m) {
      const auto row = static_cast<Eigen::Index>(m);
      EXPECT_LT((part.points_m.row(row) - whole.points_m.row(some[m])).norm(), 1e-15);
      EXPECT_LT(
          (part.jacobian.middleRows<3>(3 * row) - whole.jacobian.middleRows<3>(3 * some[m])).norm(),
          1e-14)
          << "vertex " << some[m];
    }
  }
}

TEST(VertexJacobian, MatchesAtRestAndForTinyAndLargeAngles) {
  const FootModel model = RandomModel(Family::kSupr, 24);
  ModelParameters parameters = RandomParameters(model, 25);
  parameters.theta.setZero();
  ExpectVertexJacobian(model, parameters, Variant::kCoarse);
  parameters.theta = RandomParameters(model, 26).theta * 1e-3;
  ExpectVertexJacobian(model, parameters, Variant::kCoarse);
  parameters.theta = RandomParameters(model, 26).theta * 5;
  ExpectVertexJacobian(model, parameters, Variant::kCoarse);
}

TEST(VertexJacobian, WithFewerBetasAndWithoutNetwork) {
  const FootModel model = RandomModel(Family::kStar, 27, false, false);
  ModelParameters parameters = RandomParameters(model, 28);
  for (const Eigen::Index betas : {3, 1, 0}) {
    parameters.beta.conservativeResize(betas);
    ExpectVertexJacobian(model, parameters, Variant::kFine);
  }
}

TEST(VertexJacobian, SubsetIsTheRowsOfTheWhole) {
  const FootModel model = RandomModel(Family::kSupr, 29);
  const ModelParameters parameters = RandomParameters(model, 30);
  const PointsJacobian whole = VertexJacobian(model, parameters, Variant::kFine);
  const std::vector<int> vertices = {17, 0, 5};
  const PointsJacobian some = VertexJacobian(model, parameters, Variant::kFine, vertices);
  for (Eigen::Index m = 0; m < 3; ++m) {
    const Eigen::Index i = vertices[static_cast<std::size_t>(m)];
    EXPECT_EQ(some.points_m.row(m), whole.points_m.row(i));
    EXPECT_EQ(some.jacobian.middleRows<3>(3 * m), whole.jacobian.middleRows<3>(3 * i));
  }
  EXPECT_THROW(VertexJacobian(model, parameters, Variant::kFine, std::vector<int>{20}), Error);
}

TEST(SurfacePointJacobian, MatchesNumericDerivatives) {
  const FootModel model = RandomModel(Family::kSupr, 31);
  const ModelParameters parameters = RandomParameters(model, 32);
  const std::vector<SurfacePoint> points = {
      {0, {0.2, 0.3, 0.5}}, {11, {1, 0, 0}}, {17, {0.6, -0.1, 0.5}}};
  const PointsJacobian result = SurfacePointJacobian(model, parameters, Variant::kFine, points);
  const auto f = [&](const Eigen::VectorXd& x) {
    const TriangleMesh mesh = MeshOf(
        model, Variant::kFine, Forward(model, Unpack(parameters, x), Variant::kFine).vertices_m);
    Eigen::MatrixX3d positions(3, 3);
    for (int m = 0; m < 3; ++m)
      positions.row(m) = PositionOf(mesh, points[static_cast<std::size_t>(m)]);
    return Stack(positions);
  };
  EXPECT_LT((Stack(result.points_m) - f(Pack(parameters))).cwiseAbs().maxCoeff(), 1e-13);
  testing_support::ExpectJacobianNear(f, Pack(parameters), result.jacobian, 2e-9);
}

TEST(VisitSurfacePoints, GivesTheRowsOfTheWholeInOrder) {
  const FootModel model = RandomModel(Family::kStar, 45);
  const ModelParameters parameters = RandomParameters(model, 46);
  const std::vector<SurfacePoint> points = {{3, {0.2, 0.3, 0.5}}, {9, {0, 0, 1}}};
  const PointsJacobian whole = SurfacePointJacobian(model, parameters, Variant::kFine, points);
  Eigen::Index visited = 0;
  VisitSurfacePoints(model, parameters, Variant::kFine, points,
                     [&](Eigen::Index m, const Eigen::Vector3d& position, const RowMatrix& rows) {
                       EXPECT_EQ(m, visited++);
                       EXPECT_EQ(position, whole.points_m.row(m).transpose());
                       EXPECT_EQ(rows, whole.jacobian.middleRows<3>(3 * m));
                     });
  EXPECT_EQ(visited, 2);
  const std::vector<SurfacePoint> outside = {{18, {1, 0, 0}}};
  EXPECT_THROW(VisitSurfacePoints(model, parameters, Variant::kFine, outside,
                                  [](Eigen::Index, const Eigen::Vector3d&, const RowMatrix&) {}),
               Error);
}

/// Forward's vertices as a function of contact.
auto ByContact(const FootModel& model, const ModelParameters& parameters, Variant variant) {
  return [&model, parameters, variant](const Eigen::VectorXd& contact) {
    ModelParameters changed = parameters;
    changed.contact = contact;
    return Forward(model, changed, variant).vertices_m;
  };
}

TEST(VertexContactJacobian, MatchesNumericDerivatives) {
  for (const Family family : {Family::kSupr, Family::kStar, Family::kSmpl}) {
    for (const Variant variant : {Variant::kCoarse, Variant::kFine}) {
      const FootModel model = RandomModel(family, 35);
      const ModelParameters parameters = RandomParameters(model, 36);
      const auto vertices = ByContact(model, parameters, variant);
      testing_support::ExpectJacobianNear(
          [&](const Eigen::VectorXd& contact) { return Stack(vertices(contact)); },
          parameters.contact, VertexContactJacobian(model, parameters, variant), 2e-9);
    }
  }
}

TEST(VertexContactJacobian, ForNetworksOfOneAndTwoLayersAndNone) {
  FootModel model = RandomModel(Family::kSupr, 37);
  const std::vector<NetworkLayer> layers = model.network;
  const ModelParameters parameters = RandomParameters(model, 38);
  std::mt19937_64 engine(5);
  model.network = {{testing::RandomMatrix(engine, 36, 34, 0.05), layers.back().bias}};
  for (int round = 0; round < 3; ++round) {
    Prepare(model);
    const auto vertices = ByContact(model, parameters, Variant::kFine);
    testing_support::ExpectJacobianNear(
        [&](const Eigen::VectorXd& contact) { return Stack(vertices(contact)); },
        parameters.contact, VertexContactJacobian(model, parameters, Variant::kFine), 2e-9);
    ExpectVertexJacobian(model, parameters, Variant::kFine);
    model.network.clear();
    if (round > 0) continue;
    model.network = {{testing::RandomMatrix(engine, 5, 34, 0.3), Eigen::VectorXd::Zero(5)},
                     {testing::RandomMatrix(engine, 36, 5, 0.05), layers.back().bias}};
  }
}

TEST(SurfacePointContactJacobian, MatchesNumericDerivatives) {
  const FootModel model = RandomModel(Family::kSupr, 39);
  const ModelParameters parameters = RandomParameters(model, 40);
  const std::vector<SurfacePoint> points = {{0, {0.2, 0.3, 0.5}}, {17, {0.6, -0.1, 0.5}}};
  const auto vertices = ByContact(model, parameters, Variant::kFine);
  const auto f = [&](const Eigen::VectorXd& contact) {
    const TriangleMesh mesh = MeshOf(model, Variant::kFine, vertices(contact));
    Eigen::MatrixX3d positions(2, 3);
    for (int m = 0; m < 2; ++m)
      positions.row(m) = PositionOf(mesh, points[static_cast<std::size_t>(m)]);
    return Stack(positions);
  };
  const RowMatrix jacobian = SurfacePointContactJacobian(model, parameters, Variant::kFine, points);
  testing_support::ExpectJacobianNear(f, parameters.contact, jacobian, 2e-9);
  EXPECT_THROW(SurfacePointContactJacobian(model, parameters, Variant::kFine,
                                           std::vector<SurfacePoint>{{18, {1, 0, 0}}}),
               Error);
}

TEST(JointJacobian, MatchesNumericDerivatives) {
  for (const bool affine : {false, true}) {
    const FootModel model = RandomModel(Family::kSmpl, 33, affine);
    const ModelParameters parameters = RandomParameters(model, 34);
    const PointsJacobian result = JointJacobian(model, parameters);
    const auto f = [&](const Eigen::VectorXd& x) {
      return Stack(Forward(model, Unpack(parameters, x)).joints_m);
    };
    EXPECT_LT((Stack(result.points_m) - f(Pack(parameters))).cwiseAbs().maxCoeff(), 1e-13);
    testing_support::ExpectJacobianNear(f, Pack(parameters), result.jacobian, 2e-9);
  }
}

}  // namespace
}  // namespace sole::model
