#include "model/mirror.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "random_model.h"

namespace sole::model {
namespace {

using testing::RandomModel;
using testing::RandomParameters;

TEST(MirrorModel, GivesTheMirrorImageOfThePosedFoot) {
  for (const Family family : {Family::kSupr, Family::kStar, Family::kSmpl}) {
    for (int axis = 0; axis < 3; ++axis) {
      FootModel model = RandomModel(family, 41, axis == 1);
      model.mirror_axis = axis;
      const ModelParameters parameters = RandomParameters(model, 42);
      for (const Variant variant : {Variant::kCoarse, Variant::kFine}) {
        PosedFoot wanted = Forward(model, parameters, variant);
        wanted.vertices_m.col(axis) *= -1;
        wanted.joints_m.col(axis) *= -1;
        const PosedFoot foot =
            Forward(MirrorModel(model), MirrorParameters(model, parameters), variant);
        EXPECT_LT((foot.vertices_m - wanted.vertices_m).cwiseAbs().maxCoeff(), 1e-13);
        EXPECT_LT((foot.joints_m - wanted.joints_m).cwiseAbs().maxCoeff(), 1e-13);
      }
    }
  }
}

TEST(MirrorModel, TwiceIsTheIdentity) {
  const FootModel model = RandomModel(Family::kSupr, 43, true);
  const FootModel once = MirrorModel(model), twice = MirrorModel(once);
  EXPECT_EQ(once.side, Side::kLeft);
  EXPECT_EQ(twice.side, Side::kRight);
  EXPECT_EQ(twice.coarse.triangles, model.coarse.triangles);
  EXPECT_EQ(twice.fine.template_m, model.fine.template_m);
  EXPECT_EQ(twice.fine.posedirs, model.fine.posedirs);
  EXPECT_EQ(twice.coarse.shapedirs, model.coarse.shapedirs);
  EXPECT_EQ(twice.joint_regressor, model.joint_regressor);
  EXPECT_EQ(twice.network.front().weight, model.network.front().weight);
  EXPECT_EQ(twice.network.back().bias, model.network.back().bias);
}

TEST(MirrorModel, KeepsTrianglesCounterClockwiseSeenFromOutside) {
  const FootModel model = RandomModel(Family::kSupr, 44);
  const FootModel mirrored = MirrorModel(model);
  const auto normal = [](const FootModel& m) {
    const TriangleMesh mesh = TemplateMesh(m, Variant::kCoarse);
    const Eigen::Vector3i& t = mesh.triangles[0];
    const auto at = [&](int corner) { return mesh.vertices[static_cast<std::size_t>(t[corner])]; };
    return Eigen::Vector3d((at(1) - at(0)).cross(at(2) - at(0)));
  };
  const Eigen::Vector3d before = normal(model), after = normal(mirrored);
  EXPECT_LT((after - Eigen::Vector3d(-before.x(), before.y(), before.z())).norm(), 1e-15);
}

}  // namespace
}  // namespace sole::model
