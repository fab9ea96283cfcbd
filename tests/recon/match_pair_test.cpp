#include "recon/match_pair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <cstdio>

#include "tests/recon/rectified_scene.h"
#include "tests/support/error_matcher.h"

namespace sole::recon {
namespace {

using testing::HasSubstr;
using testing_support::Ellipsoid;
using testing_support::ErrorOf;
using testing_support::MakeRectifiedScene;
using testing_support::NominalRig;
using testing_support::RectifiedScene;
using testing_support::SlantedPlane;
using testing_support::Union;

/// The flank of an ellipsoid: up to 45 degrees of slant, radii of curvature from 40 to 90 mm.
const RectifiedScene& Flank() {
  static const RectifiedScene scene =
      MakeRectifiedScene(Ellipsoid({0.028, 0.012, -0.055}, {0.07, 0.09, 0.06}));
  return scene;
}

struct Errors {
  double rms_px = 0, bias_px = 0, coverage = 0, outliers = 0;
};

Errors Compare(const ImageF& measured, const ImageF& truth) {
  Errors e;
  int count = 0, known = 0, outliers = 0;
  for (std::size_t i = 0; i < truth.pixels.size(); ++i) {
    known += std::isfinite(truth.pixels[i]) ? 1 : 0;
    const auto error = static_cast<double>(measured.pixels[i] - truth.pixels[i]);
    if (!std::isfinite(error)) continue;
    if (std::abs(error) > 0.5) {
      ++outliers;
      continue;
    }
    ++count;
    e.rms_px += error * error;
    e.bias_px += error;
  }
  e.rms_px = std::sqrt(e.rms_px / count);
  e.bias_px /= count;
  e.coverage = static_cast<double>(count) / known;
  e.outliers = static_cast<double>(outliers) / known;
  return e;
}

TEST(MatchRectified, CurvedSlantedSpeckleWithNoiseToTwoHundredthsOfAPixel) {
  const DisparityMap map = MatchRectified(Flank().left_grey, Flank().right_grey);
  const Errors e = Compare(map.disparity, Flank().disparity);
  std::printf("rms %.4f px, bias %.4f px, coverage %.3f, outliers %.5f, sigma %.4f\n", e.rms_px,
              e.bias_px, e.coverage, e.outliers, map.median_sigma_px);
  EXPECT_LT(e.rms_px, 0.02);
  EXPECT_LT(std::abs(e.bias_px), 0.004);
  EXPECT_GT(e.coverage, 0.85);
  EXPECT_LT(e.outliers, 1e-4);
  EXPECT_LT(std::abs(map.median_row_px), 0.005);
  EXPECT_LT(map.row_spread_px, 0.02);
  // The predicted standard deviation is that of the error.
  EXPECT_GT(map.median_sigma_px, 0.6 * e.rms_px);
  EXPECT_LT(map.median_sigma_px, 1.4 * e.rms_px);
}

TEST(MatchRectified, InterpolatedPointsAreAsGoodAsRefinedOnes) {
  MatchPairOptions options;
  options.step_px = 4;
  const DisparityMap map = MatchRectified(Flank().left_grey, Flank().right_grey, options);
  const Errors e = Compare(map.disparity, Flank().disparity);
  EXPECT_LT(e.rms_px, 0.021);
  EXPECT_GT(e.coverage, 0.85);
}

TEST(MatchRectified, NegativeDisparities) {
  testing_support::RectifiedSceneOptions far;
  far.offset_px = 720;
  far.width = 200;
  far.height = 120;
  const RectifiedScene scene = MakeRectifiedScene(SlantedPlane(0, 0.2, 0.3, 1, 1), far);
  MatchPairOptions options;
  options.min_disparity = -100;
  options.disparities = 80;
  const DisparityMap map = MatchRectified(scene.left_grey, scene.right_grey, options);
  const Errors e = Compare(map.disparity, scene.disparity);
  EXPECT_LT(e.rms_px, 0.02);
  EXPECT_EQ(e.outliers, 0);
  EXPECT_GT(e.coverage, 0.4);  // the rest lies outside the right image
}

TEST(MatchRectified, WhatTheRightCameraCannotSeeHasNoDisparity) {
  // A ball above a plane hides a strip of it from the right camera.
  testing_support::RectifiedSceneOptions options;
  options.offset_px = 620;
  const auto ball = Ellipsoid({0, 0, 0.03}, {0.015, 0.015, 0.015});
  const auto plane = SlantedPlane(-0.002, 0, 0, 1, 1);
  const RectifiedScene scene = MakeRectifiedScene(Union(ball, plane), options);
  MatchPairOptions match;
  match.disparities = 144;
  const DisparityMap map = MatchRectified(scene.left_grey, scene.right_grey, match);
  int hidden = 0, claimed = 0;
  const Eigen::Vector3d eye = scene.right.CentreInWorld();
  for (int y = 0; y < map.disparity.height; ++y) {
    for (int x = 0; x < map.disparity.width; ++x) {
      Eigen::Vector3d origin, direction;
      testing_support::TracePixel(scene.left, {}, x, y, origin, direction);
      if (ball.hit(origin, direction)) continue;
      const Eigen::Vector3d point = origin + *plane.hit(origin, direction) * direction;
      if (!ball.hit(eye, (point - eye).normalized())) continue;
      ++hidden;
      claimed += std::isfinite(map.disparity.At(x, y)) ? 1 : 0;
    }
  }
  std::printf("%d of %d hidden pixels have a disparity\n", claimed, hidden);
  EXPECT_GT(hidden, 2000);
  EXPECT_LT(claimed, 0.02 * hidden);
  const Errors e = Compare(map.disparity, scene.disparity);
  EXPECT_GT(e.coverage, 0.6);
  EXPECT_LT(e.outliers, 2e-3);
}

TEST(MatchRectified, ResultDoesNotDependOnThreads) {
  testing_support::RectifiedSceneOptions small;
  small.width = 160;
  small.height = 100;
  const RectifiedScene scene = MakeRectifiedScene(SlantedPlane(0, 0.2, 0.1, 1, 1), small);
  const auto run = [&](std::size_t threads) {
    const tbb::global_control cap(tbb::global_control::max_allowed_parallelism, threads);
    MatchPairOptions options;
    options.disparities = 112;
    return MatchRectified(scene.left_grey, scene.right_grey, options).disparity;
  };
  const ImageF one = run(1), many = run(4);
  for (std::size_t i = 0; i < one.pixels.size(); ++i) {
    ASSERT_TRUE(one.pixels[i] == many.pixels[i] ||
                (std::isnan(one.pixels[i]) && std::isnan(many.pixels[i])));
  }
}

TEST(MatchRectified, SaysWhatIsWrong) {
  const ImageF image(64, 64, 100);
  EXPECT_THAT(ErrorOf([&] { MatchRectified(image, ImageF(64, 63)); }),
              HasSubstr("64 x 64 pixels, the right one 64 x 63"));
  MatchPairOptions even;
  even.window_px = 8;
  EXPECT_THAT(ErrorOf([&] { MatchRectified(image, image, even); }), HasSubstr("odd number"));
  EXPECT_EQ(MatchRectified(image, image).coverage, 0);  // nothing to see, nothing claimed
}

TEST(MatchPoints, RawPairThroughGlassWithinItsCovariance) {
  const Rig rig = NominalRig(MakeDefaultRig(4, 812, 618));
  const auto foot = Ellipsoid({0, 0, 0.0381}, {0.042, 0.11, 0.038});
  const auto pair = std::find_if(rig.pairs.begin(), rig.pairs.end(), [&](const StereoPair& p) {
    return LooksThroughPlate(rig.cameras[static_cast<std::size_t>(p.left)], rig.plate);
  });
  ASSERT_NE(pair, rig.pairs.end());
  const Camera& left = rig.cameras[static_cast<std::size_t>(pair->left)];
  const Camera& right = rig.cameras[static_cast<std::size_t>(pair->right)];
  const ImageF left_grey =
      testing_support::RenderSpeckleLevels(left, rig.plate, foot, {.cell_m = 0.0014, .seed = 1});
  const ImageF right_grey =
      testing_support::RenderSpeckleLevels(right, rig.plate, foot, {.cell_m = 0.0014, .seed = 2});
  std::vector<Eigen::Vector2d> points;
  std::vector<Eigen::Vector2d> truth;
  for (double x = -0.02; x <= 0.02; x += 0.004) {
    for (double y = -0.06; y <= 0.06; y += 0.004) {
      const Eigen::Vector3d from(x, y, -0.01), up(0, 0, 1);
      const auto t = foot.hit(from, up);
      if (!t) continue;
      points.push_back(PixelFromWorld(left, rig.plate, from + *t * up));
      truth.push_back(PixelFromWorld(right, rig.plate, from + *t * up));
    }
  }
  points.emplace_back(3, 3);
  const std::vector<PointMatch> matches =
      MatchPoints(left_grey, right_grey, rig, static_cast<int>(pair - rig.pairs.begin()), points);
  ASSERT_EQ(matches.size(), points.size());
  EXPECT_EQ(matches.back().problem, "no match near it");
  int matched = 0;
  double squares = 0, normalized = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (!matches[i].problem.empty()) continue;
    ++matched;
    const Eigen::Vector2d error = matches[i].right_px - truth[i];
    squares += error.squaredNorm() / 2;
    normalized += error.dot(matches[i].covariance_px2.inverse() * error) / 2;
    EXPECT_LT(std::abs(foot.distance(matches[i].point_m)), 0.0005);
    EXPECT_LT(matches[i].gap_px, 0.3);
  }
  std::printf("%d of %zu, rms %.4f px, over sigma %.2f\n", matched, truth.size(),
              std::sqrt(squares / matched), std::sqrt(normalized / matched));
  EXPECT_GT(matched, 0.95 * static_cast<double>(truth.size()));
  EXPECT_LT(std::sqrt(squares / matched), 0.04);
  EXPECT_LT(std::sqrt(normalized / matched), 1.6);
}

}  // namespace
}  // namespace sole::recon
