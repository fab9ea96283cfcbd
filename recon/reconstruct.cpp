#include "recon/reconstruct.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <optional>
#include <utility>

#include "core/error.h"
#include "recon/surface_seeds.h"

namespace sole::recon {

struct Reconstructor::State {
  Rig rig;
  ReconstructOptions options;
  std::vector<Rectification> rectifications;  ///< per pair
  std::vector<GridOptions> grids;             ///< per pair

  /// Matches and triangulates one pair.
  PairStats MatchPair(std::size_t pair, const FrameSet& frame, const FrameSeeds* seeds,
                      FrameSeeds::Pair& next, std::vector<PairPoint>& points) const;
};

namespace {

/// Of the first points that seeds from a surface must serve; the rest are legs, marks and mirrors.
constexpr double kSurfaceShare = 0.7;

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

std::string Millimetres(double metres) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f", 1e3 * std::abs(metres));
  return text;
}

/// Grey levels and lit region of one camera's image.
struct Side {
  Foreground foreground;
  PreparedImage prepared;
  std::string problem;
};

Side PrepareSide(const Camera& camera, const std::optional<ImageU8>& image,
                 const ForegroundOptions& options) {
  Side side;
  if (!image) {
    side.problem = "no image from camera " + camera.serial;
    return side;
  }
  side.foreground = FindForeground(*image, options);
  if (!side.foreground.problem.empty()) {
    side.problem = "image of camera " + camera.serial + " is " + side.foreground.problem;
    return side;
  }
  side.prepared = Prepare(*image, &side.foreground.mask);
  return side;
}

void CheckFrame(const Rig& rig, const FrameSet& frame) {
  Require(frame.images.size() == rig.cameras.size(),
          "trigger " + std::to_string(frame.trigger) + " has " +
              std::to_string(frame.images.size()) + " images, the calibration " +
              std::to_string(rig.cameras.size()) + " cameras: calibrate this rig");
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    if (!frame.images[i]) continue;
    const ImageU8& image = *frame.images[i];
    const Camera& camera = rig.cameras[i];
    const auto pixels =
        static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
    Require(image.width == camera.width && image.height == camera.height &&
                image.pixels.size() == pixels,
            "trigger " + std::to_string(frame.trigger) + ": image of camera " + camera.serial +
                " is " + std::to_string(image.width) + " x " + std::to_string(image.height) +
                ", the calibration says " + std::to_string(camera.width) + " x " +
                std::to_string(camera.height) + ": calibrate this rig");
  }
}

/// The volume and what lies before and behind it, through the glass also above.
CaptureVolume Followed(const CaptureVolume& volume, double follow_m) {
  CaptureVolume result = volume;
  result.min_m.y() -= follow_m;
  result.max_m.y() += follow_m;
  result.max_height_through_glass_m =
      std::min(volume.max_height_through_glass_m + follow_m, volume.max_m.z());
  return result;
}

/// Pixels between matched points for the wanted spacing in the middle of the volume.
int GridStep(const Camera& camera, const CaptureVolume& volume, double spacing_m) {
  const Eigen::Vector3d middle = 0.5 * (volume.min_m + volume.max_m);
  const double px_per_m = camera.intrinsics[0] / (camera.CentreInWorld() - middle).norm();
  return std::max(1, static_cast<int>(std::lround(spacing_m * px_per_m)));
}

}  // namespace

Reconstructor::Reconstructor(const Rig& rig, const ReconstructOptions& options) {
  Require(!rig.pairs.empty(), "the rig has no stereo pairs: add a [[pair]] to the rig file");
  Require(options.spacing_m >= 0 && options.follow_m >= 0,
          "reconstruct: spacing_m and follow_m must not be negative");
  Require(rig.pairs.size() <= 255, "the rig has more than 255 stereo pairs");
  auto state = std::make_unique<State>(State{rig, options, {}, {}});
  state->options.rectify.volume = options.volume;
  state->options.triangulate.volume = Followed(options.volume, options.follow_m);
  const double usual_spacing_m = rig.pairs.size() <= 4 ? 0.00075 : 0.001;
  const double spacing_m = options.spacing_m > 0 ? options.spacing_m : usual_spacing_m;
  for (const StereoPair& pair : rig.pairs) {
    state->rectifications.push_back(Rectify(rig, pair, state->options.rectify));
    GridOptions& grid = state->grids.emplace_back(options.grid);
    grid.step_px = GridStep(rig.cameras[static_cast<std::size_t>(pair.left)], options.volume,
                            spacing_m);
  }
  state_ = std::move(state);
}

Reconstructor::~Reconstructor() = default;
Reconstructor::Reconstructor(Reconstructor&&) noexcept = default;
Reconstructor& Reconstructor::operator=(Reconstructor&&) noexcept = default;

PairStats Reconstructor::State::MatchPair(std::size_t pair, const FrameSet& frame,
                                          const FrameSeeds* seeds, FrameSeeds::Pair& next,
                                          std::vector<PairPoint>& points) const {
  const auto start = Clock::now();
  const auto left = static_cast<std::size_t>(rig.pairs[pair].left);
  const auto right = static_cast<std::size_t>(rig.pairs[pair].right);
  PairStats stats;
  stats.name = rig.pairs[pair].name;
  if (frame.kind != ExposureKind::kSpeckle) {
    stats.skipped = "texture exposure: only speckle exposures are matched";
    return stats;
  }
  const Side left_side =
      PrepareSide(rig.cameras[left], frame.images[left], options.foreground);
  const Side right_side =
      PrepareSide(rig.cameras[right], frame.images[right], options.foreground);
  stats.skipped = left_side.problem.empty() ? right_side.problem : left_side.problem;
  if (!stats.skipped.empty()) return stats;
  const FrameSeeds::Pair* before =
      seeds && pair < seeds->pairs.size() && !seeds->pairs[pair].matches.empty()
          ? &seeds->pairs[pair]
          : nullptr;
  ImageF disparity;
  const auto cold = [&] {
    disparity = InitialDisparity(*frame.images[left], *frame.images[right], rectifications[pair],
                                 options.match);
    return StartsFromDisparity(rectifications[pair], disparity, grids[pair].plane_radius_px);
  };
  const GridMatches grid = MatchOnGrid(
      left_side.prepared, right_side.prepared, left_side.foreground.mask,
      before ? StartsFromMatches(before->matches) : StartFunction(),
      before ? options.seeds_hold * before->share : 0, cold, grids[pair], options.subset);
  stats.seeded = !grid.cold;
  next.share = grid.cold ? grid.first_share : before->share;
  for (const PixelMatch& match : grid.matches) {
    const int apart = kFirstLevel * grids[pair].step_px;
    if (match.left_px.x() % apart == 0 && match.left_px.y() % apart == 0)
      next.matches.push_back(match);
  }
  stats.tried = grid.tried;
  stats.matched = static_cast<int>(grid.matches.size());
  for (const PixelMatch& match : grid.matches) stats.mean_zncc += match.match.zncc / stats.matched;
  Triangulation triangulation = Triangulate(rig, static_cast<int>(pair), grid.matches,
                                                  *frame.images[left], options.triangulate);
  stats.kept = static_cast<int>(triangulation.points.size());
  stats.median_gap_px = triangulation.median_gap_px;
  points = std::move(triangulation.points);
  if (2 * triangulation.bad_gap > stats.matched) {
    stats.skipped = "rays of matching pixels miss each other: calibrate the rig again";
  } else if (stats.kept < options.min_matches) {
    stats.skipped = "no foot in view: " + std::to_string(stats.matched) + " matches, " +
                    std::to_string(stats.kept) + " of them in the capture volume";
  }
  stats.seconds = SecondsSince(start);
  return stats;
}

FrameReconstruction Reconstructor::Reconstruct(const FrameSet& frame,
                                               const FrameSeeds* seeds) const {
  const auto start = Clock::now();
  const Rig& rig = state_->rig;
  CheckFrame(rig, frame);
  FrameReconstruction result;
  result.seeds.pairs.resize(rig.pairs.size());
  result.pairs.resize(rig.pairs.size());
  std::vector<std::vector<PairPoint>> of_pair(rig.pairs.size());
  tbb::parallel_for(std::size_t{0}, rig.pairs.size(), [&](std::size_t i) {
    // Isolated: a thread that waits for the rest of a pair's rows does not begin with another pair.
    tbb::this_task_arena::isolate([&] {
      result.pairs[i] = state_->MatchPair(i, frame, seeds, result.seeds.pairs[i], of_pair[i]);
    });
  });
  std::vector<PairPoint> points;
  for (const std::vector<PairPoint>& some : of_pair)
    points.insert(points.end(), some.begin(), some.end());
  FusedClouds fused = Fuse(points, static_cast<int>(rig.pairs.size()), state_->options.fuse);
  for (std::size_t i = 0; i < rig.pairs.size(); ++i) {
    PairStats& stats = result.pairs[i];
    stats.in_cloud = fused.foot_points[i];
    stats.offset_m = fused.offset_m[i];
    if (std::abs(stats.offset_m) > state_->options.warn_offset_m) {
      result.warnings.push_back("pair " + stats.name + " lies " + Millimetres(stats.offset_m) +
                                " mm from the other pairs: calibrate the rig again");
    }
    if (stats.skipped.empty() && fused.cloud.Size() == 0) stats.skipped = "no foot in view";
  }
  result.cloud = std::move(fused.cloud);
  result.platform = std::move(fused.platform);
  result.piece = std::move(fused.piece);
  result.pieces = std::move(fused.pieces);
  result.seconds = SecondsSince(start);
  return result;
}

FrameSeeds Reconstructor::SeedsFrom(const PointCloud& surface) const {
  FrameSeeds seeds;
  for (std::size_t i = 0; i < state_->rig.pairs.size(); ++i) {
    seeds.pairs.push_back({SeedsFromSurface(state_->rig, static_cast<int>(i), surface,
                                            kFirstLevel * state_->grids[i].step_px),
                           kSurfaceShare});
  }
  return seeds;
}

}  // namespace sole::recon
