#include "app/fit_sequences.h"

#include <algorithm>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "app/fit_feet.h"
#include "model/curation.h"
#include "model/fit.h"

namespace sole::app {
namespace {

constexpr std::size_t kSideFrames = 2;   ///< of a track that is only asked for its side
constexpr int kMostShapeFrames = 12;

/// A foot of a take: tracks of one side that do not overlap in time.
struct Foot {
  Side side = Side::kRight;
  std::vector<PointCloud> clouds;  ///< one per frame of the take
  std::size_t points = 0;
};

/// A cloud without points that are not numbers.
PointCloud Finite(const PointCloud& cloud) {
  return model::ThinForFit(cloud, std::numeric_limits<std::size_t>::max());
}

/// Side of a track by its frames with most points; nothing if none of them is a good fit.
std::optional<Side> SideOf(const FootTrack& track, const ModelPair& models) {
  std::vector<std::size_t> order(track.clouds.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return track.clouds[a].Size() > track.clouds[b].Size();
  });
  order.resize(std::min(order.size(), kSideFrames));
  std::vector<PointCloud> clouds;
  std::vector<std::int64_t> triggers;
  for (const std::size_t i : order) {
    clouds.push_back(track.clouds[i]);
    triggers.push_back(static_cast<std::int64_t>(i) + 1);
  }
  model::FitOptions options;
  options.shape_frames = static_cast<int>(clouds.size());
  FitSequence fit = model::FitFrames(models.right, models.left, clouds, triggers, options);
  CurateFit(models, clouds, fit);
  for (const FrameFit& frame : fit.frames) {
    if (frame.found && frame.verdict == "good") return frame.side;
  }
  return {};
}

void Put(const FootTrack& track, Foot& foot) {
  for (std::size_t i = 0; i < track.clouds.size(); ++i) foot.clouds[track.first + i] = track.clouds[i];
  foot.points += track.points;
}

bool Overlaps(const FootTrack& track, const Foot& foot) {
  for (std::size_t f = track.first; f < track.End(); ++f) {
    if (foot.clouds[f].Size() > 0) return true;
  }
  return false;
}

/// Feet of one take. With a single track and a single take there is nothing to decide here.
std::vector<Foot> FeetOf(const TakeClouds& take, const ModelPair& models, bool sides_needed,
                         const std::function<void(const std::string&)>& log) {
  const std::vector<FootTrack> tracks = TrackFeet(take.clouds);
  const Foot none{Side::kRight, std::vector<PointCloud>(take.clouds.size()), 0};
  if (tracks.size() <= 1 && !sides_needed) return {{Side::kRight, take.clouds, 0}};
  std::vector<Foot> feet;
  const FootTrack* unknown = nullptr;
  for (const FootTrack& track : tracks) {
    const std::optional<Side> side = SideOf(track, models);
    if (!side) {
      if (!unknown || track.points > unknown->points) unknown = &track;
      if (log) {
        log(fmt::format("triggers {} to {}: something with {} scan points a frame is taken for no foot",
                        take.triggers[track.first], take.triggers[track.End() - 1], track.points / track.clouds.size()));
      }
      continue;
    }
    auto same = std::find_if(feet.begin(), feet.end(), [&](const Foot& f) { return f.side == *side && !Overlaps(track, f); });
    if (same == feet.end()) same = feet.insert(feet.end(), none), same->side = *side;
    Put(track, *same);
  }
  // Nothing looks like a foot: the fit itself says in which way.
  if (feet.empty()) {
    feet.push_back(none);
    if (unknown) Put(*unknown, feet.back());
  }
  // One foot: whatever else was in the volume without being told apart is its own.
  if (feet.size() == 1 && tracks.size() <= 1) feet.front().clouds = take.clouds;
  std::stable_sort(feet.begin(), feet.end(), [](const Foot& a, const Foot& b) { return a.points > b.points; });
  return feet;
}

/// Feet that share a shape: of one side, and the first, second ... of that side in their take.
using ShapeKey = std::pair<Side, int>;

}  // namespace

void CurateFit(const ModelPair& models, std::span<const PointCloud> clouds, FitSequence& fit, bool in_time) {
  const FrameFit* before = nullptr;
  for (std::size_t f = 0; f < fit.frames.size(); ++f) {
    FrameFit& frame = fit.frames[f];
    if (!frame.found) {
      before = nullptr;
      continue;
    }
    const model::FootModel& model = frame.side == Side::kRight ? models.right : models.left;
    if (frame.verdict == "good")
      frame.verdict = model::CurationVerdict(model::AssessRegistration(model, fit.beta, frame, clouds[f], before));
    before = in_time && frame.verdict == "good" ? &frame : nullptr;
  }
}

std::vector<std::vector<FootFit>> FitTakes(std::span<const TakeClouds> takes, const ModelPair& models,
                                           const std::function<void(int, int)>& progress,
                                           const std::function<void(const std::string&)>& log) {
  std::vector<std::vector<Foot>> feet;
  std::map<ShapeKey, std::vector<std::pair<std::size_t, std::size_t>>> groups;  // takes and their feet
  int frames = 0, done = 0;
  for (std::size_t t = 0; t < takes.size(); ++t) {
    TakeClouds finite{{}, takes[t].triggers, {}};
    for (const PointCloud& cloud : takes[t].clouds) finite.clouds.push_back(Finite(cloud));
    feet.push_back(FeetOf(finite, models, takes.size() > 1, log));
    std::map<Side, int> seen;
    for (std::size_t k = 0; k < feet[t].size(); ++k) {
      const Side side = feet[t][k].side;
      groups[{side, seen[side]++}].emplace_back(t, k);
      frames += static_cast<int>(takes[t].clouds.size());
    }
  }
  std::vector<std::vector<FootFit>> fits(takes.size());
  for (std::size_t t = 0; t < takes.size(); ++t) fits[t].resize(feet[t].size());
  for (const auto& [key, members] : groups) {
    std::vector<PointCloud> clouds;
    std::vector<std::int64_t> triggers;
    std::vector<std::pair<std::size_t, std::size_t>> frame_of;  // take and its frame, of every cloud
    for (const auto& [t, k] : members) {
      // A frame without a foot keeps the tracking of one take out of the next.
      if (!clouds.empty()) clouds.emplace_back(), triggers.push_back(0), frame_of.emplace_back();
      for (std::size_t f = 0; f < takes[t].triggers.size(); ++f) frame_of.emplace_back(t, f);
      clouds.insert(clouds.end(), feet[t][k].clouds.begin(), feet[t][k].clouds.end());
      triggers.insert(triggers.end(), takes[t].triggers.begin(), takes[t].triggers.end());
    }
    model::FitOptions options;
    options.shape_frames = std::min(kMostShapeFrames, options.shape_frames * static_cast<int>(members.size()));
    if (takes[members.front().first].label_contact) {
      options.label_contact = [&](const Eigen::MatrixX3d& registered_m, const Eigen::VectorXd& sd_m,
                                  const Eigen::MatrixX3d& undeformed_m, std::size_t f) {
        return takes[frame_of[f].first].label_contact(registered_m, sd_m, undeformed_m, frame_of[f].second);
      };
    }
    FitSequence fit = model::FitFrames(models.right, models.left, clouds, triggers, options, [&](int frame, int) {
      if (progress) progress(std::min(frames, done + frame), frames);
    });
    std::size_t at = 0;
    for (const auto& [t, k] : members) {
      const auto begin = fit.frames.begin() + static_cast<std::ptrdiff_t>(at);
      FootFit& foot = fits[t][k];
      foot.fit = {fit.beta, fit.beta_sd, {begin, begin + static_cast<std::ptrdiff_t>(takes[t].clouds.size())}};
      foot.clouds = std::move(feet[t][k].clouds);
      CurateFit(models, foot.clouds, foot.fit);
      at += takes[t].clouds.size() + 1;
      done += static_cast<int>(takes[t].clouds.size());
    }
  }
  return fits;
}

}  // namespace sole::app
