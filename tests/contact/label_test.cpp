#include "contact/label.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/error.h"

namespace sole::contact {
namespace {

TEST(LabelContact, SplitsAtATenthOfAMillimetreAboveTheLocalGround) {
  Eigen::MatrixX3d vertices(5, 3);
  vertices << 0, 0, 0.00009, 0, 0, 0.00011, 0, 0, -0.00005, 0.1, 0, 0.00019, 0, 0, std::nan("");
  GroundPlane ground;
  ground.slope_x = 0.001;  // 0.1 mm up at x = 0.1
  const FrameContact labels = LabelContact(vertices, Eigen::VectorXd::Constant(5, 2e-5), ground);
  EXPECT_EQ(labels.contact, (std::vector<std::uint8_t>{1, 0, 1, 1, 0}));
  EXPECT_NEAR(labels.gap_m[3], 0.00009, 1e-9);
  EXPECT_TRUE(std::isnan(labels.gap_m[4]));
  EXPECT_EQ(labels.probability[4], 0);
}

TEST(LabelContact, CountsTheCalibratedResidual) {
  Eigen::MatrixX3d vertices(2, 3);
  vertices << 0, 0, 0.00015, 0.1, 0, 0.00015;
  GroundSurface calibrated;
  calibrated.spacing_m = 0.1;
  calibrated.nodes_x = calibrated.nodes_y = 2;
  calibrated.residual_m = {0.0001, 0, 0.0001, 0};  // a bump at x = 0
  const FrameContact labels = LabelContact(vertices, Eigen::VectorXd::Constant(2, 2e-5), {}, calibrated);
  EXPECT_EQ(labels.contact, (std::vector<std::uint8_t>{1, 0}));
  EXPECT_NEAR(labels.gap_m[0], 0.00005, 1e-9);
}

TEST(LabelContact, ProbabilityIsTheNormalTailOfBothUncertainties) {
  const Eigen::MatrixX3d vertices = Eigen::RowVector3d(0, 0, 0.00015);
  GroundPlane ground;
  ground.sigma_m = 3e-5;
  const FrameContact labels = LabelContact(vertices, Eigen::VectorXd::Constant(1, 4e-5), ground);
  EXPECT_NEAR(labels.probability[0], 0.158655, 1e-5);  // one standard deviation (5e-5) above
}

TEST(LabelContact, RefusesMismatchedSizes) {
  EXPECT_THROW(LabelContact(Eigen::MatrixX3d::Zero(3, 3), Eigen::VectorXd::Zero(2), {}), Error);
}

}  // namespace
}  // namespace sole::contact
