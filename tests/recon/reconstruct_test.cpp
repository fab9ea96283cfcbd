#include "recon/reconstruct.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "tests/recon/ellipsoid_cloud.h"
#include "tests/recon/speckle_scene.h"

namespace sole::recon {
namespace {

using testing_support::Ellipsoid;
using testing_support::NominalRig;
using testing_support::SlantedPlane;
using testing_support::Surface;
using testing_support::Union;

/// A foot-sized ellipsoid that rests on the glass, and a mark on the glass beside it, at half
/// resolution.
struct Scene {
  Rig rig = NominalRig(MakeDefaultRig(4, 812, 618));
  Surface foot = Ellipsoid({0, 0, 0.0381}, {0.042, 0.11, 0.038});
  FrameSet frame;

  Scene() {
    Surface mark = SlantedPlane(0, 0, 0, 0.115, 0.006);
    const auto whole = mark.hit;
    mark.hit = [whole](const Eigen::Vector3d& o,
                       const Eigen::Vector3d& d) -> std::optional<double> {
      const auto t = whole(o, d);
      return t && (o + *t * d).x() > 0.085 ? t : std::nullopt;
    };
    frame.trigger = 7;
    for (const Camera& camera : rig.cameras) {
      frame.images.emplace_back(
          testing_support::RenderSpeckle(camera, rig.plate, Union(foot, mark),
                                         {.cell_m = 0.0014, .seed = frame.images.size() + 1}));
    }
  }
};

const Scene& SharedScene() {
  static const Scene scene;
  return scene;
}

const Reconstructor& SharedReconstructor() {
  static const Reconstructor reconstructor(SharedScene().rig, {.spacing_m = 0.0016});
  return reconstructor;
}

struct Errors {
  int count = 0, outliers = 0, within_sigma = 0;
  double rms_m = 0, bias_m = 0;
};

Errors Measure(const PointCloud& cloud, const Surface& truth, int pair) {
  Errors e;
  for (std::size_t i = 0; i < cloud.Size(); ++i) {
    if (pair >= 0 && cloud.pair[i] != pair) continue;
    const double d = truth.distance(cloud.points_m[i].cast<double>());
    if (std::abs(d) > 0.001) {
      ++e.outliers;
      continue;
    }
    ++e.count;
    e.rms_m += d * d;
    e.bias_m += d;
    e.within_sigma += std::abs(d) < static_cast<double>(cloud.sigma_m[i]) ? 1 : 0;
  }
  e.rms_m = std::sqrt(e.rms_m / e.count);
  e.bias_m /= e.count;
  return e;
}

TEST(Reconstruct, SurfaceThroughGlassAndInAirWithinTheBudget) {
  const FrameReconstruction result = SharedReconstructor().Reconstruct(SharedScene().frame);
  ASSERT_EQ(result.pairs.size(), 2U);
  for (int pair = 0; pair < 2; ++pair) {
    const PairStats& stats = result.pairs[static_cast<std::size_t>(pair)];
    EXPECT_EQ(stats.skipped, "");
    EXPECT_GT(stats.matched, 0.8 * stats.tried) << stats.name;
    EXPECT_GT(stats.mean_zncc, 0.95);
    EXPECT_LT(std::abs(stats.median_gap_px), 0.03);
    const Errors e = Measure(result.cloud, SharedScene().foot, pair);
    EXPECT_GT(e.count, 3000) << stats.name;
    EXPECT_LE(e.outliers, e.count / 200) << stats.name;
    EXPECT_LT(e.rms_m, 0.0001) << stats.name;
    EXPECT_LT(std::abs(e.bias_m), 0.00005) << stats.name;
    RecordProperty(stats.name + "_rms_um", static_cast<int>(1e6 * e.rms_m));
    RecordProperty(stats.name + "_bias_um", static_cast<int>(1e6 * e.bias_m));
  }
}

TEST(Reconstruct, MarkOnTheGlassGoesToThePlatform) {
  const FrameReconstruction result = SharedReconstructor().Reconstruct(SharedScene().frame);
  EXPECT_GT(result.platform.Size(), 60U);
  for (const Eigen::Vector3f& p : result.platform.points_m) EXPECT_GT(p.x(), 0.08F);
  for (const Eigen::Vector3f& p : result.cloud.points_m) EXPECT_LT(p.x(), 0.06F);
}

TEST(Reconstruct, SameResultOnOneThread) {
  const FrameReconstruction many = SharedReconstructor().Reconstruct(SharedScene().frame);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const FrameReconstruction single = SharedReconstructor().Reconstruct(SharedScene().frame);
  EXPECT_EQ(many.cloud.points_m, single.cloud.points_m);
  EXPECT_EQ(many.cloud.sigma_m, single.cloud.sigma_m);
}

TEST(Reconstruct, MissingImageLeavesTheOtherPair) {
  FrameSet frame = SharedScene().frame;
  frame.images[1].reset();
  const FrameReconstruction result = SharedReconstructor().Reconstruct(frame);
  EXPECT_EQ(result.pairs[0].skipped, "no image from camera SIM0002");
  EXPECT_EQ(result.pairs[1].skipped, "");
  EXPECT_GT(result.pairs[1].in_cloud, 3000);
  EXPECT_EQ(result.pairs[0].in_cloud, 0);
}

TEST(Reconstruct, DarkAndSaturatedImagesAreNamed) {
  FrameSet frame = SharedScene().frame;
  frame.images[0] = ImageU8(812, 618, 2);
  frame.images[3] = ImageU8(812, 618, 255);
  const FrameReconstruction result = SharedReconstructor().Reconstruct(frame);
  EXPECT_EQ(result.pairs[0].skipped, "image of camera SIM0001 is dark");
  EXPECT_EQ(result.pairs[1].skipped, "image of camera SIM0004 is saturated");
  EXPECT_EQ(result.cloud.Size(), 0U);
}

TEST(Reconstruct, FrameWithoutFootIsEmptyWithReasons) {
  FrameSet frame;
  const Rig& rig = SharedScene().rig;
  const Surface mark = SlantedPlane(0, 0, 0, 0.115, 0.006);
  for (const Camera& camera : rig.cameras) {
    frame.images.emplace_back(
        testing_support::RenderSpeckle(camera, rig.plate, mark, {.cell_m = 0.0014}));
  }
  const FrameReconstruction result = SharedReconstructor().Reconstruct(frame);
  EXPECT_EQ(result.cloud.Size(), 0U);
  EXPECT_GT(result.platform.Size(), 100U);
  for (const PairStats& stats : result.pairs)
    EXPECT_THAT(stats.skipped, testing::HasSubstr("no foot"));
}

TEST(Reconstruct, TextureExposureIsNotMatched) {
  FrameSet frame = SharedScene().frame;
  frame.kind = ExposureKind::kTexture;
  const FrameReconstruction result = SharedReconstructor().Reconstruct(frame);
  EXPECT_EQ(result.cloud.Size(), 0U);
  EXPECT_NE(result.pairs[0].skipped.find("texture"), std::string::npos);
}

FrameSet FrameOf(const Surface& surface) {
  FrameSet frame;
  frame.trigger = 8;
  const Rig& rig = SharedScene().rig;
  for (const Camera& camera : rig.cameras) {
    frame.images.emplace_back(testing_support::RenderSpeckle(
        camera, rig.plate, surface, {.cell_m = 0.0014, .seed = frame.images.size() + 50}));
  }
  return frame;
}

TEST(Reconstruct, SeedsOfTheFrameBeforeSaveSemiGlobalMatchingAndGiveTheSameSurface) {
  const FrameReconstruction first = SharedReconstructor().Reconstruct(SharedScene().frame);
  // The foot has sunk by 0.3 mm and gone 1 mm ahead.
  const Surface moved = Ellipsoid({0, 0.001, 0.0378}, {0.042, 0.11, 0.038});
  const FrameSet frame = FrameOf(moved);
  const FrameReconstruction cold = SharedReconstructor().Reconstruct(frame);
  const FrameReconstruction warm = SharedReconstructor().Reconstruct(frame, &first.seeds);
  for (std::size_t pair = 0; pair < 2; ++pair) {
    EXPECT_FALSE(cold.pairs[pair].seeded);
    EXPECT_TRUE(warm.pairs[pair].seeded) << warm.pairs[pair].name;
    EXPECT_GT(warm.pairs[pair].kept, 0.97 * cold.pairs[pair].kept);
    const Errors e = Measure(warm.cloud, moved, static_cast<int>(pair));
    EXPECT_LT(e.rms_m, 0.0001);
    EXPECT_LT(std::abs(e.bias_m), 0.00005);
    EXPECT_LE(e.outliers, e.count / 200);
  }
}

TEST(Reconstruct, ALeapBetweenFramesDoesNoHarm) {
  const FrameReconstruction first = SharedReconstructor().Reconstruct(SharedScene().frame);
  const Surface raised = Ellipsoid({0.02, -0.05, 0.06}, {0.042, 0.09, 0.038});
  const FrameSet frame = FrameOf(raised);
  const FrameReconstruction cold = SharedReconstructor().Reconstruct(frame);
  const FrameReconstruction warm = SharedReconstructor().Reconstruct(frame, &first.seeds);
  for (std::size_t pair = 0; pair < 2; ++pair) {
    EXPECT_GT(warm.pairs[pair].kept, 0.97 * cold.pairs[pair].kept);
    const Errors e = Measure(warm.cloud, raised, static_cast<int>(pair));
    EXPECT_LT(e.rms_m, 0.0001);
    EXPECT_LE(e.outliers, e.count / 200);
  }
}

TEST(Reconstruct, SeedsThatDoNotHoldFallBackToSemiGlobalMatching) {
  const FrameReconstruction cold = SharedReconstructor().Reconstruct(SharedScene().frame);
  FrameSeeds wrong = cold.seeds;
  for (FrameSeeds::Pair& pair : wrong.pairs) {
    for (PixelMatch& match : pair.matches) match.match.warp.position_px.x() += 60;
  }
  const FrameReconstruction warm = SharedReconstructor().Reconstruct(SharedScene().frame, &wrong);
  for (std::size_t pair = 0; pair < 2; ++pair) {
    EXPECT_FALSE(warm.pairs[pair].seeded);
    EXPECT_NEAR(warm.pairs[pair].kept, cold.pairs[pair].kept, 10);
  }
}

TEST(Reconstruct, SeedsFromAPredictedSurfaceServeAsWell) {
  // The prediction is 0.2 mm too large and made of points 3 mm apart.
  const PointCloud expected =
      testing_support::EllipsoidCloud({0, 0, 0.0381}, {0.0422, 0.1102, 0.0382}, 0.003);
  const FrameSeeds seeds = SharedReconstructor().SeedsFrom(expected);
  const FrameReconstruction cold = SharedReconstructor().Reconstruct(SharedScene().frame);
  const FrameReconstruction warm =
      SharedReconstructor().Reconstruct(SharedScene().frame, &seeds);
  for (std::size_t pair = 0; pair < 2; ++pair) {
    EXPECT_TRUE(warm.pairs[pair].seeded) << warm.pairs[pair].name;
    EXPECT_GT(warm.pairs[pair].kept, 0.95 * cold.pairs[pair].kept);
  }
  PointCloud bare = expected;
  bare.normals.clear();
  EXPECT_THROW(SharedReconstructor().SeedsFrom(bare), Error);
}

TEST(Reconstruct, HalfAFootIsReconstructedAsFarAsItIsSeen) {
  // The toes are beyond the end of the capture volume.
  const Surface half = Ellipsoid({0, 0.17, 0.0381}, {0.042, 0.11, 0.038});
  const FrameReconstruction result = SharedReconstructor().Reconstruct(FrameOf(half));
  ASSERT_GT(result.cloud.Size(), 1500U);
  const Errors e = Measure(result.cloud, half, -1);
  EXPECT_LE(e.outliers, e.count / 100);
  EXPECT_LT(e.rms_m, 0.0001);
  for (const Eigen::Vector3f& p : result.cloud.points_m) EXPECT_LT(p.y(), 0.191F);
}

TEST(Reconstruct, TwoFeetAreTwoPieces) {
  const Surface left = Ellipsoid({-0.055, 0.01, 0.0381}, {0.034, 0.11, 0.038});
  const Surface right = Ellipsoid({0.055, -0.02, 0.0381}, {0.03, 0.09, 0.038});
  const FrameReconstruction result =
      SharedReconstructor().Reconstruct(FrameOf(Union(left, right)));
  ASSERT_EQ(result.pieces.size(), 2U);
  ASSERT_EQ(result.piece.size(), result.cloud.Size());
  int astray = 0;
  for (std::size_t i = 0; i < result.cloud.Size(); ++i) {
    const int other = result.cloud.points_m[i].x() > 0 ? 1 : 0;
    astray += result.piece[i] == other ? 0 : 1;
  }
  EXPECT_EQ(std::min<std::size_t>(static_cast<std::size_t>(astray),
                                  result.cloud.Size() - static_cast<std::size_t>(astray)),
            0U);
  const Errors e = Measure(result.cloud, Union(left, right), -1);
  EXPECT_LE(e.outliers, e.count / 100);
}

TEST(Reconstruct, MissingPairIsNamedAndTheOtherServes) {
  FrameSet frame = SharedScene().frame;
  frame.images[2].reset();
  frame.images[3].reset();
  const FrameReconstruction result = SharedReconstructor().Reconstruct(frame);
  EXPECT_EQ(result.pairs[1].skipped, "no image from camera SIM0003");
  EXPECT_EQ(result.pairs[0].skipped, "");
  EXPECT_GT(result.pairs[0].in_cloud, 3000);
}

TEST(Reconstruct, FramesOfAnotherRigAreRefused) {
  FrameSet frame = SharedScene().frame;
  frame.images[2] = ImageU8(640, 480, 9);
  EXPECT_THROW(SharedReconstructor().Reconstruct(frame), Error);
  frame.images.pop_back();
  EXPECT_THROW(SharedReconstructor().Reconstruct(frame), Error);
  EXPECT_THROW(Reconstructor(Rig{}), Error);
}

}  // namespace
}  // namespace sole::recon
