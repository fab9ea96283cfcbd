#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <filesystem>
#include <set>

#include "model/jacobian.h"
#include "model/mirror.h"
#include "model/model_file.h"
#include "model/triangle_topology.h"

namespace sole::model {
namespace {

/// The model that Sole ships.
const FootModel& Shipped() {
  static const FootModel model =
      LoadModel(std::filesystem::path(SOLE_SOURCE_DIR) / "models" / "sole-foot.npz");
  return model;
}

TEST(ShippedModel, HasTheSizesOfThePaper) {
  const FootModel& model = Shipped();
  EXPECT_EQ(model.NumVertices(), 266);
  EXPECT_EQ(model.coarse.triangles.rows(), 515);
  EXPECT_EQ(model.NumJoints(), 13);
  EXPECT_EQ(model.side, Side::kRight);
  EXPECT_EQ(model.licence, "Apache-2.0");
  EXPECT_GE(model.NumBetas(), 10);
  EXPECT_NEAR(static_cast<double>(model.fine.NumVertices()), 4000, 400);
}

TEST(ShippedModel, BothSurfacesAreDiscs) {
  for (const Variant variant : {Variant::kCoarse, Variant::kFine}) {
    const TriangleMesh mesh = TemplateMesh(Shipped(), variant);
    EXPECT_TRUE(IsOrientedManifold(mesh.vertices.size(), mesh.triangles));
    EXPECT_EQ(EulerCharacteristic(mesh.triangles), 1);
    const std::vector<std::vector<int>> loops = BoundaryLoops(mesh.triangles);
    ASSERT_EQ(loops.size(), 1U);
    EXPECT_EQ(loops[0].size(), variant == Variant::kCoarse ? 15U : 60U);
    for (const int v : loops[0]) EXPECT_GT(mesh.vertices[static_cast<std::size_t>(v)].z(), 0.075);
    double worst = 1;
    for (const Eigen::Vector3i& t : mesh.triangles) {
      const auto at = [&](int corner) {
        return mesh.vertices[static_cast<std::size_t>(t[corner])];
      };
      worst = std::min(worst, TriangleQuality(at(0), at(1), at(2)));
    }
    EXPECT_GT(worst, 0.1);
  }
}

TEST(ShippedModel, WeightsAreSparseAndSumToOne) {
  for (const Variant variant : {Variant::kCoarse, Variant::kFine}) {
    const Eigen::MatrixXd& weights = SurfaceOf(Shipped(), variant).weights;
    EXPECT_LT((weights.rowwise().sum().array() - 1).abs().maxCoeff(), 1e-6);
    EXPECT_GE(weights.minCoeff(), 0);
    EXPECT_LE((weights.array() > 0).rowwise().count().maxCoeff(), 4);
    // Every joint moves something.
    EXPECT_GT(weights.colwise().maxCoeff().minCoeff(), 0.4);
  }
}

TEST(ShippedModel, TheFirstFineVerticesAreTheCoarseOnes) {
  const FootModel& model = Shipped();
  EXPECT_EQ(model.fine.template_m.topRows(266), model.coarse.template_m);
  EXPECT_EQ(model.fine.weights.topRows(266), model.coarse.weights);
  EXPECT_EQ(model.fine.shapedirs.topRows(3 * 266), model.coarse.shapedirs);
  ASSERT_EQ(static_cast<Eigen::Index>(model.upsampling.size()), model.fine.NumVertices());
  for (int i = 0; i < 266; ++i) {
    EXPECT_EQ(model.upsampling[static_cast<std::size_t>(i)], (UpsamplingRow{{i, 1.0}}));
  }
}

TEST(ShippedModel, UpsamplingStaysNearTheFineSurface) {
  const FootModel& model = Shipped();
  double sum = 0;
  for (std::size_t i = 0; i < model.upsampling.size(); ++i) {
    Eigen::RowVector3d position = Eigen::RowVector3d::Zero();
    for (const auto& [vertex, weight] : model.upsampling[i])
      position += weight * model.coarse.template_m.row(vertex);
    sum += (position - model.fine.template_m.row(static_cast<Eigen::Index>(i))).norm();
  }
  EXPECT_LT(sum / static_cast<double>(model.upsampling.size()), 0.006);
}

TEST(ShippedModel, MaterialPointsAreDistinctAndOnTriangles) {
  std::set<std::pair<int, double>> seen;
  for (const SurfacePoint& point : Shipped().material) {
    EXPECT_GE(point.triangle, 0);
    EXPECT_NEAR(point.barycentric.sum(), 1, 1e-12);
    EXPECT_GE(point.barycentric.minCoeff(), 0);
    EXPECT_TRUE(
        seen.emplace(point.triangle, point.barycentric.dot(Eigen::Vector3d(1, 2, 3))).second);
  }
  EXPECT_EQ(seen.size(), 266U);
}

TEST(ShippedModel, ShapeIsStandardNormalInSizeAndGrowsWithTheFirstCoefficient) {
  const FootModel& model = Shipped();
  ModelParameters parameters = RestParameters(model);
  const auto length = [&] {
    const Eigen::MatrixX3d v = Forward(model, parameters, Variant::kFine).vertices_m;
    return v.col(1).maxCoeff() - v.col(1).minCoeff();
  };
  const double mean = length();
  EXPECT_NEAR(mean, 0.26, 0.02);
  parameters.beta[0] = 1;
  // The spread of foot length of both sexes together is about 16 mm.
  EXPECT_GT(length() - mean, 0.006);
  EXPECT_LT(length() - mean, 0.030);
}

TEST(ShippedModel, JointsLieInsideTheFootAndToesBendUpwards) {
  const FootModel& model = Shipped();
  const Eigen::MatrixX3d joints = RestJoints(model, Eigen::VectorXd::Zero(1));
  for (Eigen::Index j = 1; j < 13; ++j) {
    EXPECT_GT(joints(j, 2), 0.005) << model.joint_names[static_cast<std::size_t>(j)];
    EXPECT_LT(joints(j, 2), 0.08);
    if (j == 1) continue;
    EXPECT_GT(joints(j, 1), joints(model.parents[static_cast<std::size_t>(j)], 1));
  }
  for (int toe = 1; toe <= 5; ++toe) {
    ModelParameters parameters = RestParameters(model);
    const Eigen::MatrixX3d rest = Forward(model, parameters).vertices_m;
    parameters.theta(1 + 2 * toe, 0) = 0.5;
    const Eigen::MatrixX3d bent = Forward(model, parameters).vertices_m;
    const int tip = model.landmarks[static_cast<std::size_t>(1 + toe)].vertex;
    EXPECT_EQ(model.landmarks[static_cast<std::size_t>(1 + toe)].name,
              "toe" + std::to_string(toe) + "_tip");
    EXPECT_GT(bent(tip, 2) - rest(tip, 2), 0.008);
    // The heel does not follow.
    EXPECT_LT((bent.row(model.landmarks[0].vertex) - rest.row(model.landmarks[0].vertex)).norm(),
              1e-3);
  }
}

TEST(ShippedModel, MirrorsToALeftFoot) {
  const FootModel left = MirrorModel(Shipped());
  EXPECT_EQ(left.side, Side::kLeft);
  EXPECT_LT((left.fine.template_m.col(0) + Shipped().fine.template_m.col(0)).cwiseAbs().maxCoeff(),
            1e-15);
}

}  // namespace
}  // namespace sole::model
