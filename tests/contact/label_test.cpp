#include "contact/label.h"

#include <cmath>

#include <gtest/gtest.h>

#include "core/error.h"

namespace sole::contact {
namespace {

/// Skin above glass, scanned on a grid of 1 mm: flat on it for x < 0, leaving it as a parabola of 10 mm radius.
PointCloud Scan(double lift_m = 0) {
  PointCloud scan;
  for (int i = -20; i <= 20; ++i) {
    for (int j = -20; j <= 20; ++j) {
      const double x = 0.001 * i, z = lift_m + (x > 0 ? x * x / 0.02 : 0);
      scan.points_m.emplace_back(x, 0.001 * j, z);
      scan.normals.emplace_back(0, 0, -1);
      scan.sigma_m.push_back(1e-5F);
    }
  }
  return scan;
}

double SkinHeight(double x) { return x > 0 ? x * x / 0.02 : 0; }

/// One vertex registered at x on the skin, where the undeformed model lies `depth_m` high.
FrameContact LabelOne(double x, double depth_m, const PointCloud& scan, const GroundPlane& ground = {},
                      const GroundSurface& calibrated = {}, double sd_m = 1e-5) {
  const Eigen::MatrixX3d registered = Eigen::RowVector3d(x, 0, SkinHeight(x)), undeformed = Eigen::RowVector3d(x, 0, depth_m);
  const Eigen::VectorXd sd = Eigen::VectorXd::Constant(1, sd_m);
  return LabelContact({registered, sd, undeformed, scan}, ground, calibrated);
}

TEST(LabelContact, FindsFlatSkinTouchingAndRaisedSkinFree) {
  const FrameContact touching = LabelOne(-0.008, -0.002, Scan()), free = LabelOne(0.008, 0.001, Scan());
  EXPECT_EQ(touching.contact[0], 1);
  EXPECT_GT(touching.probability[0], 0.98);
  EXPECT_NEAR(touching.gap_m[0], 0, 2e-6);
  EXPECT_EQ(free.contact[0], 0);
  EXPECT_LT(free.probability[0], 0.02);
  EXPECT_NEAR(free.gap_m[0], SkinHeight(0.008), 1e-4);
}

TEST(LabelContact, IsUnsureWithinAMillimetreOfTheBorderAndAsksTheModel) {
  // Gap 0.1 mm at 1.4 mm: where a vertex is displaced by a millimetre either could be true.
  double before = 1;
  for (const double x : {-0.0005, 0.0005, 0.0014, 0.0025}) {
    const double p = LabelOne(x, -0.0006, Scan()).probability[0];
    EXPECT_GT(p, 0.03) << x;
    EXPECT_LT(p, 0.97) << x;
    EXPECT_LT(p, before) << x;
    before = p;
  }
  EXPECT_GT(LabelOne(0.0014, -0.002, Scan()).probability[0], 0.9);
  EXPECT_LT(LabelOne(0.0014, 0.0005, Scan()).probability[0], 0.1);
}

TEST(LabelContact, AsksTheModelAloneWhereTheScanIsMissingAndTrustsItLessTheLessItIsHeld) {
  const PointCloud none;
  EXPECT_GT(LabelOne(0, -0.002, none).probability[0], 0.9);
  EXPECT_LT(LabelOne(0, 0.001, none).probability[0], 0.1);
  const double vague = LabelOne(0, -0.002, none, {}, {}, 0.002).probability[0];
  EXPECT_GT(vague, 0.5);
  EXPECT_LT(vague, 0.85);
}

TEST(LabelContact, MeasuresFromTheLocalGround) {
  // The whole foot and the glass below it 0.3 mm lower, as on a plate that sags there.
  PointCloud scan = Scan(-0.0003);
  GroundPlane lower;
  lower.offset_m = -0.0003;
  GroundSurface sagging;
  sagging.spacing_m = 0.1;
  sagging.nodes_x = sagging.nodes_y = 2;
  sagging.first_node_m = Eigen::Vector2d(-0.05, -0.05);
  sagging.residual_m.assign(4, -0.0003);
  const FrameContact level = LabelOne(0.0014, -0.0006, Scan());
  for (const FrameContact& moved : {LabelOne(0.0014, -0.0009, scan, lower), LabelOne(0.0014, -0.0009, scan, {}, sagging)}) {
    EXPECT_NEAR(moved.probability[0], level.probability[0], 1e-3);
    EXPECT_NEAR(moved.gap_m[0], level.gap_m[0], 1e-6);
  }
  // On the plane of the unloaded plate everything here would be pressed below the glass.
  EXPECT_LT(LabelOne(0.0014, -0.0009, scan).gap_m[0], -1e-4);
}

TEST(LabelContact, LeavesOutWhatIsNotRegistered) {
  const Eigen::MatrixX3d nothing = Eigen::MatrixX3d::Constant(1, 3, std::nan(""));
  const Eigen::VectorXd sd = Eigen::VectorXd::Constant(1, std::nan(""));
  const FrameContact labels = LabelContact({nothing, sd, nothing, Scan()}, {});
  EXPECT_EQ(labels.contact[0], 0);
  EXPECT_EQ(labels.probability[0], 0);
  EXPECT_TRUE(std::isnan(labels.gap_m[0]));
}

TEST(LabelContact, RefusesMismatchedSizes) {
  const Eigen::MatrixX3d three = Eigen::MatrixX3d::Zero(3, 3);
  EXPECT_THROW(LabelContact({three, Eigen::VectorXd::Zero(2), three, PointCloud{}}, {}), Error);
}

}  // namespace
}  // namespace sole::contact
