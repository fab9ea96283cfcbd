// The shipped model with a contact-conditioned network: what contact does to its sole.
#include <gtest/gtest.h>

#include <filesystem>

#include "model/contact_network.h"
#include "model/forward.h"
#include "model/model_file.h"

namespace sole::model {
namespace {

const FootModel& Shipped() {
  static const FootModel model =
      LoadModel(std::filesystem::path(SOLE_SOURCE_DIR) / "models" / "sole-foot-contact.npz");
  return model;
}

/// Sole vertices behind or before the arch that are within 8 mm of the lowest one there.
Eigen::VectorXd SoleContact(bool heel) {
  const Eigen::MatrixX3d& points = Shipped().coarse.template_m;
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
Eigen::Vector3d MeanOffset(const Eigen::VectorXd& contact, const Eigen::VectorXd& region) {
  const ModelParameters rest = RestParameters(Shipped());
  const Eigen::VectorXd offsets =
      ContactOffsets(Shipped(), Variant::kCoarse, rest.theta, rest.beta, contact);
  return Eigen::Map<const Eigen::Matrix3Xd>(offsets.data(), 3, offsets.size() / 3) * region /
         region.sum();
}

TEST(ContactModel, IsTheShippedTopologyWithTheFullNetwork) {
  const FootModel plain =
      LoadModel(std::filesystem::path(SOLE_SOURCE_DIR) / "models" / "sole-foot.npz");
  EXPECT_EQ(KindOfNetwork(Shipped()), NetworkKind::kPoseShapeContact);
  EXPECT_EQ(Shipped().coarse.triangles, plain.coarse.triangles);
  EXPECT_EQ(Shipped().parents, plain.parents);
  EXPECT_EQ(Shipped().licence, "Apache-2.0");
  for (const ModelSurface* surface : {&Shipped().coarse, &Shipped().fine}) {
    EXPECT_LE((surface->weights.array() > 0).cast<int>().rowwise().sum().maxCoeff(), 4);
    EXPECT_LT((surface->posedirs.array() != 0).cast<double>().mean(), 0.3);
  }
}

TEST(ContactModel, PressesTheSoleWhereItTouchesAndNothingWithoutContact) {
  const Eigen::VectorXd heel = SoleContact(true), ball = SoleContact(false),
                        none = Eigen::VectorXd::Zero(heel.size());
  ASSERT_GT(heel.sum(), 5);
  ASSERT_GT(ball.sum(), 5);
  EXPECT_LT(MeanOffset(none, heel).norm(), 0.0002);
  EXPECT_LT(MeanOffset(none, ball).norm(), 0.0002);
  // Upwards, into the foot; half the contact, not as far.
  const double pressed = MeanOffset(heel, heel).z(), half = MeanOffset(0.5 * heel, heel).z();
  EXPECT_GT(pressed, 0.0003);
  EXPECT_LT(pressed, 0.008);
  EXPECT_GT(half, 0);
  EXPECT_LT(half, 0.7 * pressed);
  // The heel's contact presses the heel rather than the ball, the ball's the ball.
  EXPECT_GT(pressed, 2 * MeanOffset(heel, ball).z());
  EXPECT_GT(MeanOffset(ball, ball).z(), 2 * MeanOffset(ball, heel).z());
}

}  // namespace
}  // namespace sole::model
