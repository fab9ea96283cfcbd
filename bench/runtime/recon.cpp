// Kernels of the reconstruction and a whole frame, next to plain OpenCV (semi-global matching and
// reprojection) on the same images: a speckled, foot-sized ellipsoid on the glass, 1624 x 1236.
// usage: bench_recon [--benchmark_filter=REGEX]; the threads are those the process may use.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "recon/match_pair.h"
#include "recon/reconstruct.h"
#include "recon/subset_kernel_internal.h"
#include "tests/recon/speckle_scene.h"

namespace sole::recon {
namespace {

/// The default rig of four cameras; pair 0 and what its stages make of one frame.
struct Scene {
  Rig rig = testing_support::NominalRig(MakeDefaultRig(4, 1624, 1236));
  FrameSet frame;
  ReconstructOptions options;
  Rectification rectification = Rectify(rig, rig.pairs[0]);
  PreparedImage left, right;
  ImageU8 mask;
  ImageF disparity;
  GridOptions grid;
  GridMatches matches;

  Scene() {
    const auto foot = testing_support::Ellipsoid({0, 0, 0.0381}, {0.042, 0.11, 0.038});
    frame.trigger = 1;
    for (const Camera& camera : rig.cameras) {
      frame.images.emplace_back(testing_support::RenderSpeckle(
          camera, rig.plate, foot, {.seed = frame.images.size() + 1}));
    }
    left = Prepare(Left());
    right = Prepare(Right());
    mask = FindForeground(Left()).mask;
    disparity = InitialDisparity(Left(), Right(), rectification);
    matches = MatchOnGrid(left, right, mask, rectification, disparity, grid);
  }
  std::vector<PairPoint> Points(int pair) const {
    const StereoPair& names = rig.pairs[static_cast<std::size_t>(pair)];
    const ImageU8& a = *frame.images[static_cast<std::size_t>(names.left)];
    const ImageU8& b = *frame.images[static_cast<std::size_t>(names.right)];
    const Rectification r = Rectify(rig, names);
    const GridMatches found = MatchOnGrid(Prepare(a), Prepare(b),
                                          FindForeground(a).mask, r, InitialDisparity(a, b, r), grid);
    return Triangulate(rig, pair, found.matches, a).points;
  }
  const ImageU8& Left() const { return *frame.images[static_cast<std::size_t>(rig.pairs[0].left)]; }
  const ImageU8& Right() const {
    return *frame.images[static_cast<std::size_t>(rig.pairs[0].right)];
  }
};

const Scene& TheScene() {
  static const Scene scene;
  return scene;
}

/// One affine match from a start that is 0.3 px off; argument: radius of the window.
void SubsetPoint(benchmark::State& state) {
  const Scene& scene = TheScene();
  const SubsetOptions options{.radius_px = static_cast<int>(state.range(0))};
  std::size_t i = 0;
  long iterations = 0;
  for (auto _ : state) {
    const PixelMatch& known = scene.matches.matches[i];
    i = (i + 7919) % scene.matches.matches.size();
    SubsetWarp start = known.match.warp;
    start.position_px += Eigen::Vector2d(0.25, -0.15);
    const SubsetMatch match =
        MatchSubset(scene.left, scene.right, &scene.mask, known.left_px, start, options);
    iterations += match.iterations;
    benchmark::DoNotOptimize(match);
  }
  state.counters["iterations"] =
      static_cast<double>(iterations) / static_cast<double>(state.iterations());
}
BENCHMARK(SubsetPoint)->Arg(5)->Arg(6)->Arg(7)->Arg(10)->Unit(benchmark::kMicrosecond);

/// One comparison of a window of 13 px under a warp; argument: 0 baseline, 1 AVX2 with FMA.
void CompareWindow(benchmark::State& state) {
  const Scene& scene = TheScene();
  const bool wide = state.range(0) != 0;
  if (wide && !HasAvx2()) {
    state.SkipWithError("this processor has no AVX2");
    return;
  }
  const PixelMatch& known = scene.matches.matches[scene.matches.matches.size() / 2];
  static SubsetWindow window;
  FillWindow(scene.left.coefficients, &scene.mask, known.left_px.x(), known.left_px.y(), 6, window);
  WarpPolynomial warp{};
  for (int axis = 0; axis < 2; ++axis) {
    warp[static_cast<std::size_t>(axis)] = {known.match.warp.position_px[axis],
                                            known.match.warp.gradient(axis, 0),
                                            known.match.warp.gradient(axis, 1), 0, 0, 0};
  }
  for (auto _ : state) {
    benchmark::DoNotOptimize(wide ? CompareAvx2(window, scene.right.coefficients, warp)
                                  : CompareBaseline(window, scene.right.coefficients, warp));
  }
}
BENCHMARK(CompareWindow)->Arg(0)->Arg(1)->Unit(benchmark::kNanosecond);

void PrepareImage(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(Prepare(TheScene().Left()));
}
BENCHMARK(PrepareImage)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();

void ForegroundMask(benchmark::State& state) {
  for (auto _ : state) benchmark::DoNotOptimize(FindForeground(TheScene().Left()));
}
BENCHMARK(ForegroundMask)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();

/// Both images resampled and matched semi-globally.
void StartDisparity(benchmark::State& state) {
  const Scene& s = TheScene();
  for (auto _ : state)
    benchmark::DoNotOptimize(InitialDisparity(s.Left(), s.Right(), s.rectification));
  state.counters["megapixels"] = 1e-6 * s.rectification.width * s.rectification.height;
  state.counters["disparities"] = s.rectification.disparities;
}
BENCHMARK(StartDisparity)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();

/// The grid of one pair: starts, growth, curvature.
void GridOfAPair(benchmark::State& state) {
  const Scene& s = TheScene();
  std::size_t found = 0;
  for (auto _ : state) {
    found = MatchOnGrid(s.left, s.right, s.mask, s.rectification, s.disparity, s.grid)
                .matches.size();
  }
  state.counters["points"] = static_cast<double>(found);
}
BENCHMARK(GridOfAPair)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();

/// Exact refracted rays of both pixels, crossing, standard deviation.
void TriangulatePair(benchmark::State& state) {
  const Scene& s = TheScene();
  for (auto _ : state)
    benchmark::DoNotOptimize(Triangulate(s.rig, 0, s.matches.matches, s.Left()));
  state.counters["points"] = static_cast<double>(s.matches.matches.size());
}
BENCHMARK(TriangulatePair)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();

/// Points of all pairs to one cloud: voxels, outliers, pieces, normals.
void FusePairs(benchmark::State& state) {
  const Scene& s = TheScene();
  std::vector<PairPoint> points;
  for (int pair = 0; pair < static_cast<int>(s.rig.pairs.size()); ++pair) {
    const auto found = s.Points(pair);
    points.insert(points.end(), found.begin(), found.end());
  }
  for (auto _ : state) benchmark::DoNotOptimize(Fuse(points, static_cast<int>(s.rig.pairs.size())));
  state.counters["points"] = static_cast<double>(points.size());
}
BENCHMARK(FusePairs)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();

/// `sole match` on the rectified pair: every pixel of 0.5 Mpixel.
void RectifiedPair(benchmark::State& state) {
  const Scene& s = TheScene();
  const auto crop = [](const ImageU8& image) {
    ImageF part(812, 618);
    for (int y = 0; y < part.height; ++y) {
      std::copy_n(image.Row(y + 300).begin() + 400, part.width, part.Row(y).begin());
    }
    return part;
  };
  const ImageF left = crop(s.Left());
  MatchPairOptions options;
  options.disparities = 64;
  options.min_disparity = -32;
  double coverage = 0;
  for (auto _ : state) coverage = MatchRectified(left, left, options).coverage;
  state.counters["coverage"] = coverage;
}
BENCHMARK(RectifiedPair)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();

void WholeFrame(benchmark::State& state) {
  const Scene& s = TheScene();
  const Reconstructor reconstructor(s.rig);
  FrameReconstruction result;
  for (auto _ : state) result = reconstructor.Reconstruct(s.frame);
  state.counters["points"] = static_cast<double>(result.cloud.Size());
  for (const PairStats& pair : result.pairs) {
    state.counters["matched_" + pair.name] = pair.matched;
    state.counters["tried_" + pair.name] = pair.tried;
  }
  state.counters["pairs"] = static_cast<double>(s.rig.pairs.size());
}
BENCHMARK(WholeFrame)->Unit(benchmark::kMillisecond)->MeasureProcessCPUTime()->UseRealTime();

cv::Mat View(const ImageU8& image) {
  return {image.height, image.width, CV_8U, const_cast<std::uint8_t*>(image.pixels.data())};
}
cv::Mat View(const ImageF& image) {
  return {image.height, image.width, CV_32F, const_cast<float*>(image.pixels.data())};
}

/// What OpenCV alone does for one pair: remap, three-way semi-global matching, reprojection. No
/// refraction, no refinement. Argument: rectified pixels per raw pixel, in percent.
void PlainOpenCv(benchmark::State& state) {
  const Scene& s = TheScene();
  const double scale = 0.01 * static_cast<double>(state.range(0));
  const Rectification r =
      Rectify(s.rig, s.rig.pairs[0], {.scale = scale, .min_focal_px = 1});
  const cv::Mat q = (cv::Mat_<double>(4, 4) << 1, 0, 0, -r.left.origin_px.x(), 0, 1, 0,
                     -r.left.origin_px.y(), 0, 0, 0, r.focal_px, 0, 0, 8, 0);
  for (auto _ : state) {
    cv::Mat left, right, disparity, points;
    cv::remap(View(s.Left()), left, View(r.left.map_x), View(r.left.map_y), cv::INTER_LINEAR);
    cv::remap(View(s.Right()), right, View(r.right.map_x), View(r.right.map_y), cv::INTER_LINEAR);
    cv::StereoSGBM::create(0, r.disparities, 5, 100, 600, 1, 31, 3, 40, 2,
                           cv::StereoSGBM::MODE_SGBM_3WAY)
        ->compute(left, right, disparity);
    cv::reprojectImageTo3D(disparity, points, q, true);
    benchmark::DoNotOptimize(points.data);
  }
  state.counters["megapixels"] = 1e-6 * r.width * r.height;
  state.counters["disparities"] = r.disparities;
}
BENCHMARK(PlainOpenCv)
    ->Arg(50)
    ->Arg(100)
    ->Unit(benchmark::kMillisecond)
    ->MeasureProcessCPUTime()
    ->UseRealTime();

}  // namespace
}  // namespace sole::recon

BENCHMARK_MAIN();
