// The shipped models with a contact-conditioned network: what contact does to their soles.
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "model/contact_network.h"
#include "model/forward.h"
#include "model/model_file.h"

namespace sole::model {
namespace {

FootModel Shipped(const std::string& name) {
  return LoadModel(std::filesystem::path(SOLE_SOURCE_DIR) / "models" / name);
}

/// Sole vertices behind or before the arch that are within 8 mm of the lowest one there.
Eigen::VectorXd SoleContact(const FootModel& model, bool heel) {
  const Eigen::MatrixX3d& points = model.coarse.template_m;
  const auto counts = [&](Eigen::Index v) {
    return heel ? points(v, 1) < 0.07 : points(v, 1) > 0.15 && points(v, 1) < 0.19;
  };
  double lowest = 1;
  for (Eigen::Index v = 0; v < points.rows(); ++v)
    if (counts(v)) lowest = std::min(lowest, points(v, 2));
  Eigen::VectorXd contact = Eigen::VectorXd::Zero(points.rows());
  for (Eigen::Index v = 0; v < points.rows(); ++v)
    contact[v] = counts(v) && points(v, 2) < lowest + 0.008;
  return contact;
}

/// Mean of how far contact moves the vertices of `region` along each axis, in the rest pose.
Eigen::Vector3d MeanOffset(const FootModel& model, const Eigen::VectorXd& contact,
                           const Eigen::VectorXd& region) {
  const ModelParameters rest = RestParameters(model);
  const Eigen::VectorXd offsets =
      ContactOffsets(model, Variant::kCoarse, rest.theta, rest.beta, contact);
  return Eigen::Map<const Eigen::Matrix3Xd>(offsets.data(), 3, offsets.size() / 3) * region /
         region.sum();
}

class ContactModel : public testing::TestWithParam<const char*> {};

TEST_P(ContactModel, IsTheShippedTopologyWithTheFullNetwork) {
  const FootModel plain = Shipped("sole-foot.npz"), model = Shipped(GetParam());
  EXPECT_EQ(KindOfNetwork(model), NetworkKind::kPoseShapeContact);
  EXPECT_EQ(model.coarse.triangles, plain.coarse.triangles);
  EXPECT_EQ(model.parents, plain.parents);
  EXPECT_EQ(model.licence, "Apache-2.0");
  EXPECT_FALSE(model.pose_space.mean.size() == 0);
  for (const ModelSurface* surface : {&model.coarse, &model.fine}) {
    EXPECT_LE((surface->weights.array() > 0).cast<int>().rowwise().sum().maxCoeff(), 4);
    EXPECT_LT((surface->posedirs.array() != 0).cast<double>().mean(), 0.3);
  }
}

TEST_P(ContactModel, PressesTheSoleWhereItTouchesAndNothingWithoutContact) {
  const FootModel model = Shipped(GetParam());
  const auto offset = [&](const Eigen::VectorXd& contact, const Eigen::VectorXd& region) {
    return MeanOffset(model, contact, region);
  };
  const Eigen::VectorXd heel = SoleContact(model, true), ball = SoleContact(model, false),
                        none = Eigen::VectorXd::Zero(heel.size());
  ASSERT_GT(heel.sum(), 5);
  ASSERT_GT(ball.sum(), 5);
  EXPECT_LT(offset(none, heel).norm(), 0.0002);
  EXPECT_LT(offset(none, ball).norm(), 0.0002);
  // Upwards, into the foot; half the contact, not as far.
  const double pressed = offset(heel, heel).z(), half = offset(0.5 * heel, heel).z();
  EXPECT_GT(pressed, 0.0003);
  EXPECT_LT(pressed, 0.008);
  EXPECT_GT(half, 0);
  EXPECT_LT(half, 0.7 * pressed);
  // The heel's contact presses the heel rather than the ball, the ball's the ball.
  EXPECT_GT(pressed, 2 * offset(heel, ball).z());
  EXPECT_GT(offset(ball, ball).z(), 2 * offset(ball, heel).z());
}

INSTANTIATE_TEST_SUITE_P(Files, ContactModel,
                         testing::Values("sole-foot-contact.npz", "sole-foot-contact-female.npz",
                                         "sole-foot-contact-male.npz"));

}  // namespace
}  // namespace sole::model
