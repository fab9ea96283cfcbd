#include "calib/ground.h"

#include <cmath>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/calib/synthetic_rig.h"
#include "tests/support/error_matcher.h"

namespace sole::calib {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using sole::testing_support::ErrorOf;

/// What lies on the glass in a synthetic take of the sheet.
struct Glass {
  HeightPlane plane;
  double bulge_m = 0;  ///< in the middle, none at the sheet's corners
  double thickness_m = 0.0001;

  double At(const Eigen::Vector2d& p) const {
    return plane.At(p) + bulge_m * std::cos(M_PI * p.x() / 0.18) * std::cos(M_PI * p.y() / 0.36);
  }
};

/// Points of two pairs below and two above, 3 mm apart, with noise; pairs are off by `pair_sd_m`.
/// Also dust and, seen from above at the height of the glass, fiducials.
std::vector<SheetPoint> Points(const Glass& glass, double noise_m = 1.5e-5, double pair_sd_m = 0,
                               std::uint64_t seed = 1) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit(-1, 1);
  std::vector<SheetPoint> points;
  for (int pair = 0; pair < 4; ++pair) {
    const bool below = pair < 2;
    const double off = pair_sd_m * (pair % 2 ? 1 : -1);
    const auto add = [&](const Eigen::Vector2d& p, double z) {
      points.push_back({{p.x(), p.y(), z + off + noise_m * normal(random)}, noise_m, pair, below});
    };
    for (double x = -0.0895; x < 0.09; x += 0.0015) {
      for (double y = -0.1795; y < 0.18; y += 0.0015)
        add({x, y}, glass.At({x, y}) + (below ? 0 : glass.thickness_m));
    }
    for (int i = 0; i < 300; ++i) {
      const Eigen::Vector2d p(0.1 + 0.05 * unit(random), 0.2 * unit(random));
      add(p, glass.At(p));
    }
    for (double x = 0.1; x < 0.11; x += 0.001) {
      for (double y = -0.005; y < 0.005; y += 0.001) add({x, y}, glass.At({x, y}));
    }
    for (int i = 0; i < 200; ++i)  // wrong matches
      add({0.09 * unit(random), 0.18 * unit(random)}, 0.002 * unit(random));
  }
  return points;
}

/// Fiducials of the default rig at the height of a plane.
std::vector<GroundMark> MarksOn(const HeightPlane& plane) {
  std::vector<GroundMark> marks;
  for (const Fiducial& f : MakeDefaultRig(4).plate.fiducials)
    marks.push_back({f.id, {f.centre_m.x(), f.centre_m.y(), plane.At(f.centre_m)}, 2e-6});
  return marks;
}

/// RMS (mm) and mean (mm) of the surface above the glass where the sheet lay.
std::pair<double, double> Errors(const GroundSurface& surface, const Glass& glass) {
  double squares = 0, sum = 0;
  int count = 0;
  for (double x = -0.085; x < 0.086; x += 0.005) {
    for (double y = -0.175; y < 0.176; y += 0.005, ++count) {
      const double error = 1000 * (HeightAt(surface, {x, y}) - glass.At({x, y}));
      squares += error * error;
      sum += error;
    }
  }
  return {std::sqrt(squares / count), sum / count};
}

TEST(EstimateGround, FindsPlaneAndResidualOfABulgedGlass) {
  const RigConfig config = MakeDefaultRig(4);
  const Glass glass{{3e-5, 1e-4, -5e-5}, 6e-5};
  const GroundEstimate found = EstimateGround(Points(glass), config, MarksOn(glass.plane));
  EXPECT_LT(Errors(found.surface, glass).first, 0.0015);
  EXPECT_NEAR(found.surface.plane.slope_x, 1e-4, 2e-6);
  EXPECT_NEAR(found.surface.rms_m, 1.5e-5, 1e-6);
  EXPECT_LT(found.sigma_mm, 0.004);
  EXPECT_GT(found.sigma_mm, 0.0003);
  EXPECT_NEAR(found.thickness_mm, 0.1, 0.002);
  EXPECT_GT(found.coverage, 0.85);
  EXPECT_LE(found.coverage, 1);
  EXPECT_LT(found.surface.points, 4 * 120 * 240);  // neither dust nor fiducials
  EXPECT_GT(found.surface.points, 4 * 100 * 220);
  EXPECT_EQ(found.views.size(), 4u);
  // The bulge's mean over the sheet; marks do not bulge.
  EXPECT_NEAR(found.shift_mm, 0.06 * 4 / (M_PI * M_PI), 0.002);
  EXPECT_LT(found.tilt_mm, 0.001);
  EXPECT_THAT(found.failures, IsEmpty());
}

TEST(EstimateGround, SigmasHoldHowFarPairsDisagree) {
  const RigConfig config = MakeDefaultRig(4);
  const GroundEstimate found = EstimateGround(Points({}, 1.5e-5, 2e-5), config, MarksOn({}));
  for (const SheetView& view : found.views)
    EXPECT_NEAR(view.offset_mm, view.pair % 2 ? 0.02 : -0.02, 0.002);
  EXPECT_NEAR(found.sigma_mm, 0.02 * std::sqrt(4.0 / 3) / 2, 0.002);
}

TEST(EstimateGround, AWrongThicknessShows) {
  const RigConfig config = MakeDefaultRig(4);
  Glass glass;
  glass.thickness_m = 0.0002;  // the rig file says 0.0001
  const GroundEstimate found = EstimateGround(Points(glass), config, MarksOn({}));
  EXPECT_NEAR(found.thickness_mm, 0.2, 0.003);
  EXPECT_THAT(found.failures, Contains(HasSubstr("the sheet is 0.200 mm thick")));
  // Seen from below alone it does not matter, and cannot be told.
  std::vector<SheetPoint> below = Points(glass);
  std::erase_if(below, [](const SheetPoint& p) { return !p.from_below; });
  const GroundEstimate lower = EstimateGround(below, config, MarksOn({}));
  EXPECT_THAT(lower.failures, IsEmpty());
  EXPECT_TRUE(std::isnan(lower.thickness_mm));
  EXPECT_LT(std::abs(Errors(lower.surface, glass).second), 0.001);
  // From above alone the surface is too high by what the thickness is wrong.
  std::vector<SheetPoint> above = Points(glass);
  std::erase_if(above, [](const SheetPoint& p) { return p.from_below; });
  const GroundEstimate upper = EstimateGround(above, config, MarksOn({}));
  EXPECT_NEAR(Errors(upper.surface, glass).second, 0.1, 0.002);
  EXPECT_THAT(upper.failures, Contains(HasSubstr("above the fiducials' plane")));
}

TEST(EstimateGround, ASheetTiltedAgainstTheFiducialsShows) {
  const RigConfig config = MakeDefaultRig(4);
  const Glass glass{{0, 0, 5e-4}};  // one end rests on something
  const GroundEstimate found = EstimateGround(Points(glass), config, MarksOn({}));
  EXPECT_LT(Errors(found.surface, glass).first, 0.0015);
  EXPECT_NEAR(found.tilt_mm, 0.09, 0.004);
  EXPECT_THAT(found.failures, Contains(HasSubstr("tilted against the fiducials' plane")));
  // The whole plate tilted: fiducials and sheet agree.
  EXPECT_THAT(EstimateGround(Points(glass), config, MarksOn(glass.plane)).failures, IsEmpty());
}

TEST(EstimateGround, RefusesTooLittle) {
  const RigConfig config = MakeDefaultRig(4);
  EXPECT_THAT(ErrorOf([&] { EstimateGround({}, config, {}); }),
              HasSubstr("0 points of the contact sheet"));
  std::vector<SheetPoint> corner = Points({});
  std::erase_if(corner, [](const SheetPoint& p) { return p.point_m.y() < 0.05; });
  EXPECT_THAT(EstimateGround(corner, config, {}).failures,
              Contains(HasSubstr("of the sheet was seen")));
}

TEST(GroundShift, IsWhatTheFiducialsMovedBy) {
  GroundSurface surface;
  surface.marks = MarksOn({1e-5, 0, 1e-5});
  const HeightPlane shift = GroundShift(surface, MarksOn({5e-5, 2e-4, 1e-5}));
  EXPECT_NEAR(shift.offset_m, 4e-5, 1e-9);
  EXPECT_NEAR(shift.slope_x, 2e-4, 1e-8);
  EXPECT_NEAR(shift.slope_y, 0, 1e-8);
}

TEST(MeasureMarks, TriangulatesFiducialsThroughTheGlassAndFromAbove) {
  const testing_support::SyntheticRig truth = testing_support::MakeSyntheticRig(4, 3, 5);
  Rig rig;
  for (std::size_t c = 0; c < 4; ++c) {
    Camera camera{"", 1624, 1236, Intrinsics::Zero(), truth.cam_from_world[c]};
    camera.intrinsics.head<8>() = truth.lens[c];
    rig.cameras.push_back(camera);
  }
  rig.plate = {truth.thickness_m, truth.index};
  TakeObservations take = testing_support::ObserveSynthetic(truth, 0.03, 5);
  const std::vector<GroundMark> marks = MeasureMarks(rig, truth.config, take);
  ASSERT_GE(marks.size(), 8u);
  for (const GroundMark& mark : marks) {
    const Eigen::Vector2d centre =
        truth.config.plate.fiducials.at(static_cast<std::size_t>(mark.id - 200)).centre_m;
    EXPECT_LT((mark.point_m - Eigen::Vector3d(centre.x(), centre.y(), 0)).norm(), 5e-5);
    EXPECT_GT(mark.sigma_m, 2e-6);
    EXPECT_LT(mark.sigma_m, 3e-5);
  }
  for (auto& frame : take.frames) {
    for (auto& view : frame) view.fiducials.clear();
  }
  EXPECT_THAT(MeasureMarks(rig, truth.config, take), IsEmpty());
}

}  // namespace
}  // namespace sole::calib
