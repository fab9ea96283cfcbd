#include "model/measure.h"

#include <map>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "tests/support/meshes.h"

namespace sole::model {
namespace {

/// A "foot" whose measures are known in closed form: an ellipsoid of length 0.26, width 0.10, height 0.08 on
/// the ground, toes towards +y.
struct Known {
  FootModel model;
  FrameFit frame;
};

Known EllipsoidFoot(const Eigen::Matrix3d& turn, Side side) {
  TriangleMesh mesh = testing_support::Ellipsoid({0.05, 0.13, 0.04}, 240, 240);
  Known known;
  known.model.side = side;
  const auto n = static_cast<Eigen::Index>(mesh.vertices.size());
  known.model.coarse.template_m.resize(n, 3);
  known.model.coarse.triangles.resize(static_cast<Eigen::Index>(mesh.triangles.size()), 3);
  known.frame.found = true;
  known.frame.registration_m.resize(n, 3);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector3d p = mesh.vertices[static_cast<std::size_t>(i)] + Eigen::Vector3d(0, 0.13, 0.04);
    known.model.coarse.template_m.row(i) = p;
    known.frame.registration_m.row(i) = (turn * p + Eigen::Vector3d(0.02, -0.1, 0.001)).transpose();
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    known.model.coarse.triangles.row(static_cast<Eigen::Index>(t)) = mesh.triangles[t];
  }
  known.frame.vertex_sd_m = Eigen::VectorXd::Constant(n, 0.0003);
  known.frame.registration_sd_m = Eigen::VectorXd::Constant(n, 0.0004);
  return known;
}

std::map<std::string, FootMeasure> ByName(const std::vector<FootMeasure>& measures) {
  std::map<std::string, FootMeasure> map;
  for (const FootMeasure& m : measures) map[m.name] = m;
  return map;
}

TEST(MeasureFrame, ClosedFormOfAnEllipsoidInAnyHeading) {
  GroundPlane ground;
  ground.offset_m = 0.001;
  for (const double degrees : {0.0, 37.0, 180.0}) {
    const Eigen::Matrix3d turn = Eigen::AngleAxisd(degrees * M_PI / 180, Eigen::Vector3d::UnitZ()).matrix();
    for (const Side side : {Side::kRight, Side::kLeft}) {
      const Known known = EllipsoidFoot(turn, side);
      auto m = ByName(MeasureFrame(known.model, known.frame, ground));
      EXPECT_NEAR(m["length"].value_m, 0.26, 1e-4) << degrees;
      // At share s of the length the half width is 0.05 sqrt(1 - (2 s - 1)^2), largest at s = 0.55.
      EXPECT_NEAR(m["ball_width"].value_m, 0.1 * std::sqrt(1 - 0.01), 1e-4);
      EXPECT_NEAR(m["instep_height"].value_m, 0.08, 1e-4);
      double heel = 0;
      for (double s = 0.13; s < 0.195; s += 0.01) heel += 0.1 * std::sqrt(1 - (2 * s - 1) * (2 * s - 1)) / 7;
      EXPECT_NEAR(m["heel_width"].value_m, heel, 2e-4);
      // The ellipsoid's underside 20 mm beside the axis is highest at the end of the span furthest from its middle.
      const double share = 2 * 0.36 - 1, beside = 0.02 / 0.05;
      EXPECT_NEAR(m["arch_height"].value_m, 0.04 * (1 - std::sqrt(1 - share * share - beside * beside)), 3e-4);
      EXPECT_NEAR(m["length"].sd_m, 0.0003 * std::sqrt(2.0), 1e-9);
    }
  }
}

TEST(StandsOnGround, NotOnTiptoeOnTheHeelOrInTheAir) {
  const Eigen::Vector3d x = Eigen::Vector3d::UnitX();
  for (const double degrees : {0.0, 2.0, 20.0, -20.0}) {
    Known known = EllipsoidFoot(Eigen::AngleAxisd(degrees * M_PI / 180, x).matrix(), Side::kRight);
    known.frame.registration_m.col(2).array() -= known.frame.registration_m.col(2).minCoeff();
    EXPECT_EQ(StandsOnGround(known.model, known.frame, {}), std::abs(degrees) < 10) << degrees;
    known.frame.registration_m.col(2).array() += 0.01;
    EXPECT_FALSE(StandsOnGround(known.model, known.frame, {})) << degrees;
  }
  Known missing = EllipsoidFoot(Eigen::Matrix3d::Identity(), Side::kRight);
  missing.frame.found = false;
  EXPECT_FALSE(StandsOnGround(missing.model, missing.frame, {}));
}

TEST(MeasureFrame, NothingWithoutAFoot) {
  Known known = EllipsoidFoot(Eigen::Matrix3d::Identity(), Side::kRight);
  known.frame.found = false;
  EXPECT_TRUE(MeasureFrame(known.model, known.frame, {}).empty());
}

}  // namespace
}  // namespace sole::model
