#include "recon/grid_match.h"

#include <tbb/parallel_for.h>

#include <vector>

#include "core/error.h"
#include "recon/match_nodes_internal.h"

namespace sole::recon {
namespace {

/// What a warp says of the place `to` left pixels away.
SubsetWarp Extrapolate(const SubsetWarp& from, const Eigen::Vector2i& to) {
  const Eigen::Vector2d d = to.cast<double>();
  SubsetWarp warp = from;
  warp.position_px = from(d);
  warp.gradient.col(0) += from.curvature.leftCols<2>() * d;
  warp.gradient.col(1) += from.curvature.rightCols<2>() * d;
  return warp;
}

class Grid {
 public:
  Grid(const PreparedImage& left, const PreparedImage& right, const ImageU8& mask,
       const GridOptions& options, const SubsetOptions& subset)
      : left_(left),
        right_(right),
        mask_(mask),
        options_(options),
        subset_(subset),
        nodes_(mask, options) {}

  /// First level: affine matches of every kFirstLevel-th node of every kFirstLevel-th row.
  void MatchFirstLevel(const StartFunction& start_of) {
    nodes_.SetStride(kFirstLevel);
    const std::vector<int> level = nodes_.Unmatched();
    tbb::parallel_for(std::size_t{0}, level.size(), [&](std::size_t k) {
      const auto start = start_of(nodes_.Pixel(level[k]));
      if (!start) return;
      const SubsetMatch match = Match(level[k], *start, subset_);
      if (match.status == SubsetStatus::kMatched) nodes_.Set(level[k], match);
    });
    Grow(subset_);
  }

  /// Share of the first level's nodes that have a match.
  double MatchedShare() const {
    int lit = 0, matched = 0;
    for (int i = 0; i < nodes_.Count(); ++i) {
      if (!nodes_.OnLevel(i)) continue;
      ++lit;
      matched += nodes_.Matched(i) ? 1 : 0;
    }
    return lit == 0 ? 0 : static_cast<double>(matched) / lit;
  }

  /// Second level: every node from what the first level's warps around it say, with the curvature
  /// that their slopes imply, then growth into nodes that had none around.
  void MatchSecondLevel() {
    const std::vector<SubsetWarp> first = nodes_.CurvedWarps();
    std::vector<SubsetMatch> matches(first.size());
    tbb::parallel_for(0, nodes_.Count(), [&](int i) {
      for (const int from : nodes_.NearestOnLevel(i)) {
        if (from < 0) break;
        matches[Index(i)] = Match(i, Extrapolated(first[Index(from)], from, i), subset_);
        if (matches[Index(i)].status == SubsetStatus::kMatched) break;
      }
    });
    nodes_.Clear();
    for (int i = 0; i < nodes_.Count(); ++i) {
      if (matches[Index(i)].status == SubsetStatus::kMatched) nodes_.Set(i, matches[Index(i)]);
    }
    nodes_.SetStride(1);
    Grow(subset_);
    if (options_.curvature_reach > 0) {
      for (int i = 0; i < nodes_.Count(); ++i) nodes_.ScaleCovariance(i, kCurvatureVarianceFactor);
    }
    GrowWithWiderWindows();
    for (int i = 0; i < nodes_.Count(); ++i) {
      const double variance = 0.5 * nodes_.Match(i).covariance_px2.trace();
      nodes_.ScaleCovariance(i, 1 + variance / (kDoubtfulSigma_px * kDoubtfulSigma_px));
    }
  }

  GridMatches Collect() const {
    GridMatches result;
    result.tried = nodes_.Count();
    for (int i = 0; i < nodes_.Count(); ++i) {
      if (nodes_.Matched(i) && nodes_.NeighboursAgree(i))
        result.matches.push_back({nodes_.Pixel(i), nodes_.Match(i)});
    }
    return result;
  }

 private:
  static std::size_t Index(int i) { return static_cast<std::size_t>(i); }
  SubsetMatch Match(int i, const SubsetWarp& start, const SubsetOptions& subset) const {
    return MatchSubset(left_, right_, &mask_, nodes_.Pixel(i), start, subset);
  }
  SubsetWarp Extrapolated(const SubsetWarp& warp, int from, int to) const {
    return Extrapolate(warp, nodes_.Pixel(to) - nodes_.Pixel(from));
  }

  /// Grows from matched nodes of the level into their unmatched neighbours until nothing is left
  /// to try. A node gets two tries, from different neighbours.
  void Grow(const SubsetOptions& subset) {
    struct Open {
      int node;
      int from = -1;  ///< neighbour of the last try
      int tries = 0;
    };
    std::vector<Open> open;
    for (const int i : nodes_.Unmatched()) open.push_back({i});
    std::vector<std::size_t> starts;
    for (int round = 0; round < options_.max_rounds; ++round) {
      starts.clear();
      for (std::size_t k = 0; k < open.size(); ++k) {
        const int from = nodes_.BestNeighbour(open[k].node);
        if (from < 0 || from == open[k].from) continue;
        open[k].from = from;
        ++open[k].tries;
        starts.push_back(k);
      }
      if (starts.empty()) return;
      std::vector<SubsetMatch> found(starts.size());
      tbb::parallel_for(std::size_t{0}, starts.size(), [&](std::size_t k) {
        const Open& o = open[starts[k]];
        found[k] = Match(o.node, Extrapolated(nodes_.Warp(o.from), o.from, o.node), subset);
      });
      for (std::size_t k = 0; k < starts.size(); ++k) {
        if (found[k].status == SubsetStatus::kMatched) nodes_.Set(open[starts[k]].node, found[k]);
      }
      std::erase_if(open, [&](const Open& o) { return o.tries >= 2 || nodes_.Matched(o.node); });
    }
  }

  /// Where a foot moves during the exposure the dots are smeared and small windows hold too little:
  /// beside matched nodes larger ones are tried.
  void GrowWithWiderWindows() {
    if (options_.wide_radius_px <= subset_.radius_px) return;
    const std::vector<int> unmatched = nodes_.Unmatched();
    SubsetOptions wide = subset_;
    wide.radius_px = options_.wide_radius_px;
    Grow(wide);
    for (const int i : unmatched) {
      if (nodes_.Matched(i)) nodes_.ScaleCovariance(i, kWideVarianceFactor);
    }
  }

  const PreparedImage& left_;
  const PreparedImage& right_;
  const ImageU8& mask_;
  const GridOptions& options_;
  const SubsetOptions& subset_;
  MatchNodes nodes_;
};

}  // namespace

GridMatches MatchOnGrid(const PreparedImage& left, const PreparedImage& right, const ImageU8& mask,
                        const StartFunction& start, const GridOptions& grid,
                        const SubsetOptions& subset) {
  return MatchOnGrid(left, right, mask, start, 0, {}, grid, subset);
}

GridMatches MatchOnGrid(const PreparedImage& left, const PreparedImage& right, const ImageU8& mask,
                        const StartFunction& seeds, double min_share,
                        const std::function<StartFunction()>& cold, const GridOptions& grid,
                        const SubsetOptions& subset) {
  Require(grid.step_px >= 1 && grid.plane_radius_px >= 1,
          "grid step_px and plane_radius_px must be at least 1");
  Grid nodes(left, right, mask, grid, subset);
  if (seeds) nodes.MatchFirstLevel(seeds);
  const bool ask = cold && (!seeds || nodes.MatchedShare() < min_share);
  if (ask) nodes.MatchFirstLevel(cold());
  const double share = nodes.MatchedShare();
  nodes.MatchSecondLevel();
  GridMatches result = nodes.Collect();
  result.first_share = share;
  result.cold = !cold || ask;
  return result;
}

GridMatches MatchOnGrid(const PreparedImage& left, const PreparedImage& right, const ImageU8& mask,
                        const Rectification& rectification, const ImageF& disparity,
                        const GridOptions& grid, const SubsetOptions& subset) {
  return MatchOnGrid(left, right, mask,
                     StartsFromDisparity(rectification, disparity, grid.plane_radius_px), grid,
                     subset);
}

}  // namespace sole::recon
