#include "recon/match_nodes_internal.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace sole::recon {
namespace {

constexpr double kAgreementSigmas = 3;  // by which neighbours may differ

}  // namespace

MatchNodes::MatchNodes(const ImageU8& mask, const GridOptions& options)
    : options_(options),
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
  Clear();
}

void MatchNodes::Clear() {
  matches_.assign(nodes_.size(), {});
  matched_.assign(nodes_.size(), 0);
}

std::vector<int> MatchNodes::Unmatched() const {
  std::vector<int> nodes;
  for (int i = 0; i < Count(); ++i) {
    if (OnLevel(i) && !Matched(i)) nodes.push_back(i);
  }
  return nodes;
}

int MatchNodes::BestNeighbour(int i) const {
  int best = -1;
  ForNeighbours(i, [&](int j) {
    if (best < 0 || matches_[Index(j)].zncc > matches_[Index(best)].zncc) best = j;
  });
  return best;
}

std::array<int, 4> MatchNodes::NearestOnLevel(int i) const {
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

std::vector<SubsetWarp> MatchNodes::CurvedWarps() const {
  std::vector<SubsetWarp> warps(nodes_.size());
  tbb::parallel_for(0, Count(), [&](int i) {
    if (!OnLevel(i) || !Matched(i)) return;
    warps[Index(i)] = Warp(i);
    if (options_.curvature_reach > 0) warps[Index(i)].curvature = CurvatureAround(i);
  });
  return warps;
}

Eigen::Matrix<double, 2, 3> MatchNodes::CurvatureAround(int i) const {
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

bool MatchNodes::NeighboursAgree(int i) const {
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

}  // namespace sole::recon
