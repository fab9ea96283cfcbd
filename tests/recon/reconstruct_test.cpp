#include "recon/reconstruct.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>

#include "core/error.h"
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
