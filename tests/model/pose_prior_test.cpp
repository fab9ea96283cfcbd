// Gaussian of poses that holds a fit where the scan does not show a part.
#include "model/pose_prior.h"

#include <algorithm>
#include <filesystem>
#include <string>

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include "model/forward.h"
#include "model/model_file.h"
#include "model/pose_fit.h"
#include "tests/support/meshes.h"

namespace sole::model {
namespace {

/// With a pose space.
const FootModel& ContactModel() {
  static const FootModel model = LoadModel(std::filesystem::path(SOLE_SOURCE_DIR) / "models" / "sole-foot-contact.npz");
  return model;
}

Eigen::Index Joint(const std::string& name) {
  const auto& names = ContactModel().joint_names;
  return std::find(names.begin(), names.end(), name) - names.begin();
}

TEST(PosePrior, HasTheCovarianceOfThePoseSpaceWithAFloor) {
  const FootModel& model = ContactModel();
  const PoseSpace& space = model.pose_space;
  const double floor2 = 0.05 * 0.05;
  const PosePrior prior = PosePriorOf(model, {.floor_rad = 0.05});
  const Eigen::Index values = space.mean.size();
  EXPECT_EQ(prior.root.topRows<3>().norm(), 0);  // the root turns freely
  const Eigen::MatrixXd root = prior.root.bottomRightCorner(values, values);
  const Eigen::MatrixXd covariance = (root.transpose() * root).inverse();
  for (Eigen::Index c = 0; c < space.components.cols(); ++c) {
    const Eigen::VectorXd axis = space.components.col(c);
    EXPECT_NEAR((axis.dot(covariance * axis)), space.variances[c] + floor2, 1e-5);
  }
  EXPECT_NEAR(covariance.trace(), space.variances.sum() + static_cast<double>(values) * floor2, 1e-4);
}

TEST(PosePrior, OfAModelWithoutAPoseSpaceHoldsJointsToTheirRest) {
  FootModel model = ContactModel();
  model.pose_space = {};
  Eigen::MatrixX3d theta = Eigen::MatrixX3d::Zero(model.NumJoints(), 3);
  theta(0, 1) = 2;  // the root does not count
  theta(4, 0) = 0.6;
  const Eigen::VectorXd deviations = PosePriorOf(model, {.free_rad = 0.3}).Deviations(theta);
  EXPECT_NEAR(deviations[4], 2, 1e-12);
  EXPECT_NEAR(deviations.sum(), 2, 1e-12);
}

TEST(PosePrior, NamesTheToeThatIsBentSidewaysNotThoseThatCurlTogether) {
  const FootModel& model = ContactModel();
  const PosePrior prior = PosePriorOf(model);
  Eigen::MatrixX3d curled = Eigen::MatrixX3d::Zero(model.NumJoints(), 3);
  for (int toe = 1; toe <= 5; ++toe) curled(Joint("toe" + std::to_string(toe) + "_mtp"), 0) = 0.4;
  EXPECT_LT(prior.Deviations(curled).maxCoeff(), 4);
  Eigen::MatrixX3d sideways = Eigen::MatrixX3d::Zero(model.NumJoints(), 3);
  sideways(Joint("toe2_ip"), 2) = 0.7;
  Eigen::Index most = 0;
  EXPECT_GT(prior.Deviations(sideways).maxCoeff(&most), 6);
  EXPECT_EQ(model.joint_names[static_cast<std::size_t>(most)], "toe2_ip");
}

TEST(FitPose, LetsAToeWithoutScanPointsFollowTheOthers) {
  const FootModel& model = ContactModel();
  ModelParameters raised = RestParameters(model);
  for (int toe = 1; toe <= 5; ++toe) raised.theta(Joint("toe" + std::to_string(toe) + "_mtp"), 0) = 0.4;
  const TriangleMesh mesh = MeshOf(model, Variant::kFine, Forward(model, raised, Variant::kFine).vertices_m);
  const PointCloud whole = testing_support::SampleMesh(mesh, 6000, 5e-5, 7);
  // Without the middle toe.
  const Eigen::Index tip = Joint("toe3_ip"), base = Joint("toe3_mtp");
  PointCloud scan;
  for (std::size_t i = 0; i < whole.Size(); ++i) {
    Eigen::Index nearest = 0;
    double best = 1;
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
      const double d = (mesh.vertices[v] - whole.points_m[i].cast<double>()).squaredNorm();
      if (d < best) best = d, nearest = static_cast<Eigen::Index>(v);
    }
    if (model.fine.weights(nearest, tip) + model.fine.weights(nearest, base) > 0.05) continue;
    scan.points_m.push_back(whole.points_m[i]);
    scan.normals.push_back(whole.normals[i]);
  }
  ASSERT_LT(scan.Size(), whole.Size() - 50);
  const PoseFitStage stage{20, 0.03, 0.004, 0.0005, true, false};
  const auto toe_error = [&](const FootModel& with) {
    const PoseFit fit = FitPose(with, scan, RestParameters(with), stage);
    const Eigen::MatrixX3d fitted = Forward(with, fit.parameters).vertices_m, truth = Forward(model, raised).vertices_m;
    double worst = 0;
    for (Eigen::Index v = 0; v < fitted.rows(); ++v) {
      if (model.coarse.weights(v, tip) > 0.5) worst = std::max(worst, (fitted.row(v) - truth.row(v)).norm());
    }
    return worst;
  };
  FootModel unaware = model;
  unaware.pose_space = {};
  const double aware_m = toe_error(model), unaware_m = toe_error(unaware);
  EXPECT_LT(aware_m, 0.004);
  EXPECT_LT(aware_m, 0.6 * unaware_m) << aware_m << " " << unaware_m;  // that one stays near its rest
}

}  // namespace
}  // namespace sole::model
