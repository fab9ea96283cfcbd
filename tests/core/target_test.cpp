#include "core/target.h"

#include <cmath>
#include <set>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "core/error.h"

namespace sole {
namespace {

constexpr double kEdge = 0.10;
const Eigen::Vector3d kOutward[] = {-Eigen::Vector3d::UnitZ(), Eigen::Vector3d::UnitX(), -Eigen::Vector3d::UnitX(),
                                    Eigen::Vector3d::UnitY(), -Eigen::Vector3d::UnitY()};

CalibrationBody Cube() { return MakeCalibrationCube(kEdge, 5, 0.018, 0.0135); }

TEST(MakeCalibrationCube, FacesLieCentredOnTheirSidesInTheDocumentedOrder) {
  const CalibrationBody cube = Cube();
  ASSERT_EQ(cube.faces.size(), 5U);
  EXPECT_EQ(cube.edge_m, kEdge);
  for (std::size_t f = 0; f < 5; ++f) {
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (int corner = 0; corner < 16; ++corner) {
      const Eigen::Vector3d point = CornerInBody(cube.faces[f], corner);
      EXPECT_NEAR(point.dot(kOutward[f]), kEdge / 2, 1e-15) << "face " << f << ", corner " << corner;
      mean += point / 16;
    }
    EXPECT_LT((mean - kEdge / 2 * kOutward[f]).norm(), 1e-15) << f;
  }
}

TEST(MakeCalibrationCube, PrintsAreNotMirrored) {
  // Seen from outside, printed x runs to the right of printed y running down: x cross y points inwards.
  const CalibrationBody cube = Cube();
  for (std::size_t f = 0; f < 5; ++f) {
    const Eigen::Vector3d origin = CornerInBody(cube.faces[f], 0);
    const Eigen::Vector3d x = CornerInBody(cube.faces[f], 1) - origin;
    const Eigen::Vector3d y = CornerInBody(cube.faces[f], 4) - origin;
    EXPECT_NEAR(x.norm(), 0.018, 1e-15);
    EXPECT_NEAR(y.norm(), 0.018, 1e-15);
    EXPECT_LT((x.cross(y).normalized() + kOutward[f]).norm(), 1e-12) << f;
  }
}

TEST(MakeCalibrationCube, MarkerIdsFollowEachOtherWithoutOverlap) {
  std::set<int> ids;
  int next = 0;
  for (const CharucoFace& face : Cube().faces) {
    EXPECT_EQ(face.first_id, next);
    for (int i = 0; i < MarkerCount(face); ++i) EXPECT_TRUE(ids.insert(next++).second);
  }
  EXPECT_EQ(ids.size(), 60U);  // 12 white squares of 25 on each of five faces
}

TEST(MakeCalibrationCube, RefusesBoardsThatDoNotFit) {
  EXPECT_THROW(MakeCalibrationCube(0.1, 6, 0.018, 0.0135), Error);
  EXPECT_THROW(MakeCalibrationCube(0.1, 5, 0.018, 0.018), Error);
  EXPECT_THROW(MakeCalibrationCube(0.1, 2, 0.018, 0.0135), Error);
}

TEST(CornerInBody, CountsRowByRowOnABoardThatIsNotSquare) {
  CharucoFace face{4, 6, 0.02, 0.015, 0, {}};
  face.body_from_board.translation = {1, 2, 3};
  EXPECT_LT((CornerInBody(face, 0) - Eigen::Vector3d(1.02, 2.02, 3)).norm(), 1e-15);
  EXPECT_LT((CornerInBody(face, 2) - Eigen::Vector3d(1.06, 2.02, 3)).norm(), 1e-15);
  EXPECT_LT((CornerInBody(face, 3) - Eigen::Vector3d(1.02, 2.04, 3)).norm(), 1e-15);
  EXPECT_LT((CornerInBody(face, 14) - Eigen::Vector3d(1.06, 2.10, 3)).norm(), 1e-15);
  EXPECT_EQ(MarkerCount(face), 12);
}

TEST(FiducialCorners, RunClockwiseFromTheTopLeftSeenFromAbove) {
  const auto corners = FiducialCorners({200, {0.1, -0.2}, 0.012});
  EXPECT_LT((corners[0] - Eigen::Vector3d(0.094, -0.194, 0)).norm(), 1e-15);
  double twice_area = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector3d &a = corners[i], &b = corners[(i + 1) % 4];
    EXPECT_EQ(a.z(), 0);
    EXPECT_NEAR((b - a).norm(), 0.012, 1e-15);
    twice_area += a.x() * b.y() - a.y() * b.x();
  }
  EXPECT_NEAR(twice_area / 2, -0.012 * 0.012, 1e-15);  // negative: clockwise
}

}  // namespace
}  // namespace sole
