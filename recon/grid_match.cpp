#include "recon/grid_match.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <unordered_map>
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
        nodes_(static_cast<std::size_t>(cols_) * static_cast<std::size_t>(rows_)) {
    for (int i = 0; i < Count(); ++i) At(i).lit = mask.At(Pixel(i).x(), Pixel(i).y()) != 0;
  }

  /// First level: affine matches of every kFirstLevel-th node of every kFirstLevel-th row.
  void MatchFirstLevel(const StartFunction& start_of) {
    stride_ = kFirstLevel;
    tbb::parallel_for(0, Count(), [&](int i) {
      if (!OnLevel(i) || !At(i).lit || Matched(i)) return;
      const auto start = start_of(Pixel(i));
      if (start) Try(i, *start);
    });
    for (int i = 0; i < Count(); ++i) At(i).grown = 0;
    GrowAll();
  }

  /// Share of the first level's lit nodes that have a match.
  double MatchedShare() const {
    int lit = 0, matched = 0;
    for (int i = 0; i < Count(); ++i) {
      if (!OnLevel(i) || !At(i).lit) continue;
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
    tbb::parallel_for(0, Count(), [&](int i) {
      if (!At(i).lit) return;
      const auto best = NearestOnLevel(i);
      for (const int from : best) {
        if (from < 0) break;
        SubsetMatch match = MatchSubset(left_, right_, &mask_, Pixel(i),
                                        Extrapolate(first[static_cast<std::size_t>(from)],
                                                    Pixel(i) - Pixel(from)),
                                        subset_);
        if (match.status != SubsetStatus::kMatched) continue;
        matches[static_cast<std::size_t>(i)] = match;
        break;
      }
    });
    for (int i = 0; i < Count(); ++i) {
      At(i).match = matches[static_cast<std::size_t>(i)];
      At(i).grown = 0;
    }
    stride_ = 1;
    GrowAll();
    if (options_.curvature_reach == 0) return;
    for (Node& node : nodes_) node.match.covariance_px2 *= kCurvatureVarianceFactor;
  }

  GridMatches Collect() const {
    GridMatches result;
    for (int i = 0; i < Count(); ++i) {
      result.tried += At(i).lit ? 1 : 0;
      if (Matched(i) && NeighboursAgree(i)) result.matches.push_back({Pixel(i), At(i).match});
    }
    return result;
  }

 private:
  struct Node {
    bool lit = false;
    int grown = 0;
    SubsetMatch match;
  };

  int Count() const { return cols_ * rows_; }
  Node& At(int i) { return nodes_[static_cast<std::size_t>(i)]; }
  const Node& At(int i) const { return nodes_[static_cast<std::size_t>(i)]; }
  bool Matched(int i) const { return At(i).match.status == SubsetStatus::kMatched; }
  Eigen::Vector2i Pixel(int i) const {
    return {i % cols_ * options_.step_px, i / cols_ * options_.step_px};
  }

  bool OnLevel(int i) const { return i % cols_ % stride_ == 0 && i / cols_ % stride_ == 0; }

  /// Grows from matched nodes of the level into their unmatched neighbours until nothing is left
  /// to try.
  void GrowAll() {
    for (int round = 0; round < options_.max_rounds && Grow(); ++round) {
    }
  }

  /// One round of growing; false when nothing was left to try.
  bool Grow() {
    std::vector<std::pair<int, SubsetWarp>> starts;
    for (int i = 0; i < Count(); ++i) {
      Node& node = At(i);
      if (!OnLevel(i) || !node.lit || Matched(i) || node.grown >= 2) continue;
      const int from = BestNeighbour(i);
      if (from < 0) continue;
      ++node.grown;
      starts.emplace_back(i, Extrapolate(At(from).match.warp, Pixel(i) - Pixel(from)));
    }
    tbb::parallel_for(std::size_t{0}, starts.size(),
                      [&](std::size_t k) { Try(starts[k].first, starts[k].second); });
    return !starts.empty();
  }

  /// Warps of the level's matches, with curvature.
  std::vector<SubsetWarp> CurvedWarps() const {
    std::vector<SubsetWarp> warps(nodes_.size());
    tbb::parallel_for(0, Count(), [&](int i) {
      if (!OnLevel(i) || !Matched(i)) return;
      warps[static_cast<std::size_t>(i)] = At(i).match.warp;
      if (options_.curvature_reach > 0)
        warps[static_cast<std::size_t>(i)].curvature = CurvatureAround(i);
    });
    return warps;
  }

  /// The matched nodes of the first level around a node, nearest first, -1 where there is none.
  std::array<int, 4> NearestOnLevel(int i) const {
    const int x = i % cols_, y = i / cols_;
    std::array<std::pair<int, int>, 4> around;  // squared distance, node
    std::size_t count = 0;
    for (const int cy : {y / stride_ * stride_, (y + stride_ - 1) / stride_ * stride_}) {
      for (const int cx : {x / stride_ * stride_, (x + stride_ - 1) / stride_ * stride_}) {
        if (cx >= cols_ || cy >= rows_ || !Matched(cy * cols_ + cx)) continue;
        const std::pair<int, int> entry((cx - x) * (cx - x) + (cy - y) * (cy - y), cy * cols_ + cx);
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

  void Try(int i, const SubsetWarp& start) {
    SubsetMatch match = MatchSubset(left_, right_, &mask_, Pixel(i), start, subset_);
    if (match.status == SubsetStatus::kMatched) At(i).match = match;
  }

  /// Calls f(index) for the up to eight neighbours of node i on the level.
  template <typename F>
  void ForNeighbours(int i, const F& f) const {
    const int x = i % cols_, y = i / cols_;
    for (int dy = -stride_; dy <= stride_; dy += stride_) {
      for (int dx = -stride_; dx <= stride_; dx += stride_) {
        if ((dx == 0 && dy == 0) || x + dx < 0 || y + dy < 0 || x + dx >= cols_ || y + dy >= rows_)
          continue;
        f(i + dy * cols_ + dx);
      }
    }
  }

  int BestNeighbour(int i) const {
    int best = -1;
    ForNeighbours(i, [&](int j) {
      if (Matched(j) && (best < 0 || At(j).match.zncc > At(best).match.zncc)) best = j;
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
    const int cx = i % cols_, cy = i / cols_;
    Eigen::Matrix2d moments = Eigen::Matrix2d::Zero();
    std::array<Eigen::Matrix2d, 2> slopes{Eigen::Matrix2d::Zero(), Eigen::Matrix2d::Zero()};
    int count = 0;
    for (int y = cy - reach; y <= cy + reach; y += stride_) {
      for (int x = cx - reach; x <= cx + reach; x += stride_) {
        const int j = y * cols_ + x;
        if (x < 0 || y < 0 || x >= cols_ || y >= rows_ || j == i || !Matched(j)) continue;
        const Eigen::Vector2d d = (Pixel(j) - Pixel(i)).cast<double>();
        const SubsetWarp& other = At(j).match.warp;
        const SubsetWarp& own = At(i).match.warp;
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
    ForNeighbours(i, [&](int j) {
      if (!Matched(j)) return;
      ++matched;
      const Eigen::Vector2d off =
          At(j).match.warp.position_px - At(i).match.warp((Pixel(j) - Pixel(i)).cast<double>());
      agreeing += off.norm() < options_.agreement_px ? 1 : 0;
    });
    return agreeing >= options_.min_agreeing && 2 * agreeing >= matched;
  }

  const PreparedImage& left_;
  const PreparedImage& right_;
  const ImageU8& mask_;
  const GridOptions& options_;
  const SubsetOptions& subset_;
  int cols_, rows_;
  int stride_ = 1;  ///< nodes between those of the level that is being matched
  std::vector<Node> nodes_;
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
  std::unordered_map<std::uint64_t, const PixelMatch*> by_pixel;
  for (const PixelMatch& match : matches) by_pixel.emplace(key(match.left_px), &match);
  return [by_pixel = std::move(by_pixel), key](const Eigen::Vector2i& px) -> std::optional<SubsetWarp> {
    const auto found = by_pixel.find(key(px));
    if (found == by_pixel.end()) return {};
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
