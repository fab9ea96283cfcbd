#include "recon/grid_match.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>

#include "core/error.h"

namespace sole::recon {
namespace {

/// Disparity near a rectified pixel as a plane: value there and slopes.
struct LocalDisparity {
  double value = 0, slope_x = 0, slope_y = 0;
};

std::optional<LocalDisparity> FitDisparity(const ImageF& disparity, const Eigen::Vector2d& at,
                                           int radius) {
  const int cx = static_cast<int>(std::lround(at.x())), cy = static_cast<int>(std::lround(at.y()));
  if (cx < radius || cy < radius || cx >= disparity.width - radius ||
      cy >= disparity.height - radius)
    return {};
  const auto centre = static_cast<double>(disparity.At(cx, cy));
  if (!std::isfinite(centre)) return {};
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d rhs = Eigen::Vector3d::Zero();
  int count = 0;
  for (int y = cy - radius; y <= cy + radius; ++y) {
    for (int x = cx - radius; x <= cx + radius; ++x) {
      const auto d = static_cast<double>(disparity.At(x, y));
      if (!(std::abs(d - centre) <= 0.75 * radius)) continue;
      const Eigen::Vector3d row(1, x - at.x(), y - at.y());
      normal += row * row.transpose();
      rhs += row * d;
      ++count;
    }
  }
  if (count < (2 * radius + 1) * (2 * radius + 1) / 3) return LocalDisparity{centre, 0, 0};
  const Eigen::Vector3d plane = normal.ldlt().solve(rhs);
  if (!plane.allFinite() || std::abs(plane[0] - centre) > 1.5) return LocalDisparity{centre, 0, 0};
  return LocalDisparity{plane[0], plane[1], plane[2]};
}

constexpr double kAgreementSigmas = 3;  // by which neighbours may differ

class Grid {
 public:
  Grid(const PreparedImage& left, const PreparedImage& right, const ImageU8& mask,
       const GridOptions& options, const SubsetOptions& subset)
      : left_(left),
        right_(right),
        mask_(mask),
        options_(options),
        subset_(subset),
        cols_((mask.width - 1) / options.step_px + 1),
        rows_((mask.height - 1) / options.step_px + 1),
        node_at_(static_cast<std::size_t>(cols_) * static_cast<std::size_t>(rows_), -1) {
    for (int y = 0; y < rows_; ++y) {
      for (int x = 0; x < cols_; ++x) {
        if (mask.At(x * options.step_px, y * options.step_px) == 0) continue;
        node_at_[Place(x, y)] = static_cast<int>(nodes_.size());
        nodes_.push_back({x, y});
      }
    }
    matches_.resize(nodes_.size());
    matched_.assign(nodes_.size(), 0);
  }

  /// First level: affine matches of every kFirstLevel-th node of every kFirstLevel-th row.
  void MatchFirstLevel(const StartFunction& start_of) {
    stride_ = kFirstLevel;
    const std::vector<int> level = Unmatched();
    tbb::parallel_for(std::size_t{0}, level.size(), [&](std::size_t k) {
      const auto start = start_of(Pixel(level[k]));
      if (start) Try(level[k], *start);
    });
    Grow(subset_);
  }

  /// Share of the first level's nodes that have a match.
  double MatchedShare() const {
    int lit = 0, matched = 0;
    for (int i = 0; i < Count(); ++i) {
      if (!OnLevel(i)) continue;
      ++lit;
      matched += Matched(i) ? 1 : 0;
    }
    return lit == 0 ? 0 : static_cast<double>(matched) / lit;
  }

  /// Second level: every node from what the first level's warps around it say, with the curvature
  /// that their slopes imply, then growth into nodes that had none around.
  void MatchSecondLevel() {
    const std::vector<SubsetWarp> first = CurvedWarps();
    std::vector<SubsetMatch> matches(nodes_.size());
    std::vector<char> matched(nodes_.size());
    tbb::parallel_for(0, Count(), [&](int i) {
      const auto best = NearestOnLevel(i);
      for (const int from : best) {
        if (from < 0) break;
        const SubsetMatch match =
            MatchSubset(left_, right_, &mask_, Pixel(i),
                        Extrapolate(first[Index(from)], Pixel(i) - Pixel(from)), subset_);
        if (match.status != SubsetStatus::kMatched) continue;
        matches[Index(i)] = match;
        matched[Index(i)] = 1;
        break;
      }
    });
    matches_ = std::move(matches);
    matched_ = std::move(matched);
    stride_ = 1;
    Grow(subset_);
    if (options_.curvature_reach > 0) {
      for (SubsetMatch& match : matches_) match.covariance_px2 *= kCurvatureVarianceFactor;
    }
    GrowWithWiderWindows();
    for (SubsetMatch& match : matches_) {
      const double variance = 0.5 * match.covariance_px2.trace();
      match.covariance_px2 *= 1 + variance / (kDoubtfulSigma_px * kDoubtfulSigma_px);
    }
  }

  GridMatches Collect() const {
    GridMatches result;
    result.tried = Count();
    for (int i = 0; i < Count(); ++i) {
      if (Matched(i) && NeighboursAgree(i)) result.matches.push_back({Pixel(i), matches_[Index(i)]});
    }
    return result;
  }

 private:
  /// A lit grid point by its column and row.
  struct Node {
    int x, y;
  };

  static std::size_t Index(int i) { return static_cast<std::size_t>(i); }
  std::size_t Place(int x, int y) const { return Index(y * cols_ + x); }
  /// Number of the node there; -1 outside of the grid or where it is not lit.
  int NodeAt(int x, int y) const {
    return x < 0 || y < 0 || x >= cols_ || y >= rows_ ? -1 : node_at_[Place(x, y)];
  }
  int Count() const { return static_cast<int>(nodes_.size()); }
  const SubsetWarp& Warp(int i) const { return matches_[Index(i)].warp; }
  bool Matched(int i) const { return matched_[Index(i)] != 0; }
  Eigen::Vector2i Pixel(int i) const {
    return {nodes_[Index(i)].x * options_.step_px, nodes_[Index(i)].y * options_.step_px};
  }
  bool OnLevel(int i) const {
    return nodes_[Index(i)].x % stride_ == 0 && nodes_[Index(i)].y % stride_ == 0;
  }

  /// Nodes of the level without a match.
  std::vector<int> Unmatched() const {
    std::vector<int> nodes;
    for (int i = 0; i < Count(); ++i) {
      if (OnLevel(i) && !Matched(i)) nodes.push_back(i);
    }
    return nodes;
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
    for (const int i : Unmatched()) open.push_back({i});
    std::vector<std::size_t> starts;
    for (int round = 0; round < options_.max_rounds; ++round) {
      starts.clear();
      for (std::size_t k = 0; k < open.size(); ++k) {
        const int from = BestNeighbour(open[k].node);
        if (from < 0 || from == open[k].from) continue;
        open[k].from = from;
        ++open[k].tries;
        starts.push_back(k);
      }
      if (starts.empty()) return;
      std::vector<SubsetMatch> found(starts.size());
      tbb::parallel_for(std::size_t{0}, starts.size(), [&](std::size_t k) {
        const Open& o = open[starts[k]];
        found[k] = MatchSubset(left_, right_, &mask_, Pixel(o.node),
                               Extrapolate(Warp(o.from), Pixel(o.node) - Pixel(o.from)), subset);
      });
      for (std::size_t k = 0; k < starts.size(); ++k) {
        if (found[k].status == SubsetStatus::kMatched) Set(open[starts[k]].node, found[k]);
      }
      std::erase_if(open, [&](const Open& o) { return o.tries >= 2 || Matched(o.node); });
    }
  }

  /// Where a foot moves during the exposure the dots are smeared and small windows hold too little:
  /// beside matched nodes larger ones are tried.
  void GrowWithWiderWindows() {
    if (options_.wide_radius_px <= subset_.radius_px) return;
    const std::vector<char> before = matched_;
    SubsetOptions wide = subset_;
    wide.radius_px = options_.wide_radius_px;
    Grow(wide);
    for (std::size_t i = 0; i < matches_.size(); ++i) {
      if (matched_[i] && !before[i]) matches_[i].covariance_px2 *= kWideVarianceFactor;
    }
  }

  /// Warps of the level's matches, with curvature.
  std::vector<SubsetWarp> CurvedWarps() const {
    std::vector<SubsetWarp> warps(nodes_.size());
    tbb::parallel_for(0, Count(), [&](int i) {
      if (!OnLevel(i) || !Matched(i)) return;
      warps[Index(i)] = Warp(i);
      if (options_.curvature_reach > 0) warps[Index(i)].curvature = CurvatureAround(i);
    });
    return warps;
  }

  /// The matched nodes of the first level around a node, nearest first, -1 where there is none.
  std::array<int, 4> NearestOnLevel(int i) const {
    const auto [x, y] = nodes_[Index(i)];
    std::array<std::pair<int, int>, 4> around;  // squared distance, node
    std::size_t count = 0;
    for (const int cy : {y / stride_ * stride_, (y + stride_ - 1) / stride_ * stride_}) {
      for (const int cx : {x / stride_ * stride_, (x + stride_ - 1) / stride_ * stride_}) {
        const int node = NodeAt(cx, cy);
        if (node < 0 || !Matched(node)) continue;
        const std::pair<int, int> entry((cx - x) * (cx - x) + (cy - y) * (cy - y), node);
        if (std::find(around.begin(), around.begin() + count, entry) != around.begin() + count)
          continue;
        around[count++] = entry;
      }
    }
    std::sort(around.begin(), around.begin() + count);
    std::array<int, 4> nodes{-1, -1, -1, -1};
    for (std::size_t k = 0; k < count; ++k) nodes[k] = around[k].second;
    return nodes;
  }

  void Set(int i, const SubsetMatch& match) {
    matches_[Index(i)] = match;
    matched_[Index(i)] = 1;
  }
  void Try(int i, const SubsetWarp& start) {
    const SubsetMatch match = MatchSubset(left_, right_, &mask_, Pixel(i), start, subset_);
    if (match.status == SubsetStatus::kMatched) Set(i, match);
  }

  /// Calls f(node) for the matched ones of the up to eight neighbours of node i on the level.
  template <typename F>
  void ForNeighbours(int i, const F& f) const {
    const auto [x, y] = nodes_[Index(i)];
    for (int dy = -stride_; dy <= stride_; dy += stride_) {
      for (int dx = -stride_; dx <= stride_; dx += stride_) {
        if (dx == 0 && dy == 0) continue;
        const int j = NodeAt(x + dx, y + dy);
        if (j >= 0 && Matched(j)) f(j);
      }
    }
  }

  int BestNeighbour(int i) const {
    int best = -1;
    ForNeighbours(i, [&](int j) {
      if (best < 0 || matches_[Index(j)].zncc > matches_[Index(best)].zncc) best = j;
    });
    return best;
  }

  /// What a warp says of the place `to` left pixels away.
  static SubsetWarp Extrapolate(const SubsetWarp& from, const Eigen::Vector2i& to) {
    const Eigen::Vector2d d = to.cast<double>();
    SubsetWarp warp = from;
    warp.position_px = from(d);
    warp.gradient.col(0) += from.curvature.leftCols<2>() * d;
    warp.gradient.col(1) += from.curvature.rightCols<2>() * d;
    return warp;
  }

  /// Least-squares change of the neighbours' warp gradients with position; zero where too few
  /// agree.
  Eigen::Matrix<double, 2, 3> CurvatureAround(int i) const {
    const int reach = std::max(1, options_.curvature_reach / stride_) * stride_;
    const auto [cx, cy] = nodes_[Index(i)];
    Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
    std::array<Eigen::Matrix2d, 2> slopes{Eigen::Matrix2d::Zero(), Eigen::Matrix2d::Zero()};
    int count = 0;
    for (int y = cy - reach; y <= cy + reach; y += stride_) {
      for (int x = cx - reach; x <= cx + reach; x += stride_) {
        const int j = NodeAt(x, y);
        if (j < 0 || j == i || !Matched(j)) continue;
        const Eigen::Vector2d d = (Pixel(j) - Pixel(i)).cast<double>();
        const SubsetWarp& other = Warp(j);
        const SubsetWarp& own = Warp(i);
        // The trapezoid rule is exact for a quadratic warp; a match on another surface fails it.
        const Eigen::Vector2d expected =
            own.position_px + 0.5 * (own.gradient + other.gradient) * d;
        if ((expected - other.position_px).norm() > options_.agreement_px) continue;
        moments += d * d.transpose();
        for (int axis = 0; axis < 2; ++axis) {
          slopes[static_cast<std::size_t>(axis)] += d[axis] * (other.gradient - own.gradient);
        }
        ++count;
      }
    }
    Eigen::Matrix<double, 2, 3> curvature = Eigen::Matrix<double, 2, 3>::Zero();
    const int across = 2 * reach / stride_ + 1;
    const int full = across * across - 1;
    if (3 * count < full || !(moments.determinant() > 0.02 * moments.trace() * moments.trace()))
      return curvature;
    const Eigen::Matrix2d inverse = moments.inverse();
    const Eigen::Matrix2d by_x = inverse(0, 0) * slopes[0] + inverse(0, 1) * slopes[1];
    const Eigen::Matrix2d by_y = inverse(1, 0) * slopes[0] + inverse(1, 1) * slopes[1];
    curvature.col(0) = by_x.col(0);
    curvature.col(1) = 0.5 * (by_x.col(1) + by_y.col(0));
    curvature.col(2) = by_y.col(1);
    return curvature;
  }

  bool NeighboursAgree(int i) const {
    int matched = 0, agreeing = 0;
    const double own = matches_[Index(i)].covariance_px2.trace();
    ForNeighbours(i, [&](int j) {
      ++matched;
      // Uncertain matches may differ by what they are uncertain.
      const double variance = 0.5 * (own + matches_[Index(j)].covariance_px2.trace());
      const double allowed_px = std::max(options_.agreement_px, kAgreementSigmas * std::sqrt(variance));
      const Eigen::Vector2d off =
          Warp(j).position_px - Warp(i)((Pixel(j) - Pixel(i)).cast<double>());
      agreeing += off.norm() < allowed_px ? 1 : 0;
    });
    return agreeing >= options_.min_agreeing && 2 * agreeing >= matched;
  }

  const PreparedImage& left_;
  const PreparedImage& right_;
  const ImageU8& mask_;
  const GridOptions& options_;
  const SubsetOptions& subset_;
  int cols_, rows_;
  int stride_ = 1;  ///< grid points between those of the level that is being matched
  std::vector<int> node_at_;
  std::vector<Node> nodes_;  ///< row by row
  std::vector<SubsetMatch> matches_;
  std::vector<char> matched_;
};

}  // namespace

StartFunction StartsFromDisparity(const Rectification& rectification, const ImageF& disparity,
                                  int radius_px) {
  return [&rectification, &disparity,
          radius_px](const Eigen::Vector2i& pixel) -> std::optional<SubsetWarp> {
    const RectifiedView& view = rectification.left;
    const Eigen::Vector2d raw = pixel.cast<double>();
    const Eigen::Vector2d centre = RectifiedFromRaw(rectification, view, raw);
    if (!centre.allFinite()) return {};
    const auto local = FitDisparity(disparity, centre, radius_px);
    if (!local) return {};
    const auto map = [&](const Eigen::Vector2d& left_px) {
      const Eigen::Vector2d rect = RectifiedFromRaw(rectification, view, left_px);
      const double d = local->value + local->slope_x * (rect.x() - centre.x()) +
                       local->slope_y * (rect.y() - centre.y());
      return LookUpRaw(rectification.right, rect - Eigen::Vector2d(d, 0));
    };
    constexpr double kStep = 4;
    SubsetWarp warp;
    warp.position_px = map(raw);
    warp.gradient.col(0) = (map(raw + Eigen::Vector2d(kStep, 0)) - warp.position_px) / kStep;
    warp.gradient.col(1) = (map(raw + Eigen::Vector2d(0, kStep)) - warp.position_px) / kStep;
    if (!warp.position_px.allFinite() || !warp.gradient.allFinite()) return {};
    return warp;
  };
}

StartFunction StartsFromDisparity(const ImageF& disparity, int radius_px) {
  return [&disparity, radius_px](const Eigen::Vector2i& pixel) -> std::optional<SubsetWarp> {
    const auto local = FitDisparity(disparity, pixel.cast<double>(), radius_px);
    if (!local) return {};
    SubsetWarp warp;
    warp.position_px = Eigen::Vector2d(pixel.x() - local->value, pixel.y());
    warp.gradient << 1 - local->slope_x, -local->slope_y, 0, 1;
    return warp;
  };
}

StartFunction StartsFromMatches(std::span<const PixelMatch> matches) {
  const auto key = [](const Eigen::Vector2i& px) {
    return static_cast<std::uint64_t>(px.y()) << 32 | static_cast<std::uint32_t>(px.x());
  };
  using Entry = std::pair<std::uint64_t, const PixelMatch*>;
  std::vector<Entry> by_pixel;
  by_pixel.reserve(matches.size());
  for (const PixelMatch& match : matches) by_pixel.emplace_back(key(match.left_px), &match);
  std::ranges::sort(by_pixel, {}, &Entry::first);
  return [by_pixel = std::move(by_pixel),
          key](const Eigen::Vector2i& px) -> std::optional<SubsetWarp> {
    const auto found = std::ranges::lower_bound(by_pixel, key(px), {}, &Entry::first);
    if (found == by_pixel.end() || found->first != key(px)) return {};
    return found->second->match.warp;
  };
}

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
