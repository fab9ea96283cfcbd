#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include "core/image.h"
#include "recon/grid_match.h"
#include "recon/subset.h"

namespace sole::recon {

/// The lit points of a grid over the left image, numbered row by row, and what they match so far.
class MatchNodes {
 public:
  MatchNodes(const ImageU8& mask, const GridOptions& options);

  int Count() const { return static_cast<int>(nodes_.size()); }
  Eigen::Vector2i Pixel(int i) const {
    return {nodes_[Index(i)].x * options_.step_px, nodes_[Index(i)].y * options_.step_px};
  }
  bool Matched(int i) const { return matched_[Index(i)] != 0; }
  const SubsetMatch& Match(int i) const { return matches_[Index(i)]; }
  const SubsetWarp& Warp(int i) const { return matches_[Index(i)].warp; }
  void Set(int i, const SubsetMatch& match) {
    matches_[Index(i)] = match;
    matched_[Index(i)] = 1;
  }
  /// Forgets all matches.
  void Clear();
  /// Multiplies what a match says of its own variance.
  void ScaleCovariance(int i, double factor) { matches_[Index(i)].covariance_px2 *= factor; }

  /// Grid points between those of the level that is being matched.
  void SetStride(int stride) { stride_ = stride; }
  bool OnLevel(int i) const {
    return nodes_[Index(i)].x % stride_ == 0 && nodes_[Index(i)].y % stride_ == 0;
  }
  /// Nodes of the level without a match.
  std::vector<int> Unmatched() const;
  /// Of the matched ones among the up to eight neighbours on the level: the one that correlates
  /// best, -1 if there is none.
  int BestNeighbour(int i) const;
  /// The matched nodes of the level around a node, nearest first, -1 where there is none.
  std::array<int, 4> NearestOnLevel(int i) const;
  /// Warps of the level's matches, with the curvature that the neighbours' slopes imply.
  std::vector<SubsetWarp> CurvedWarps() const;
  /// Whether enough neighbours lie where the node's own warp expects them.
  bool NeighboursAgree(int i) const;

 private:
  struct Node {
    int x, y;  ///< column and row
  };

  static std::size_t Index(int i) { return static_cast<std::size_t>(i); }
  std::size_t Place(int x, int y) const { return Index(y * cols_ + x); }
  /// Number of the node there; -1 outside of the grid or where it is not lit.
  int NodeAt(int x, int y) const {
    return x < 0 || y < 0 || x >= cols_ || y >= rows_ ? -1 : node_at_[Place(x, y)];
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

  /// Change of the neighbours' warp gradients with position; zero where too few agree.
  Eigen::Matrix<double, 2, 3> CurvatureAround(int i) const;

  const GridOptions& options_;
  int cols_, rows_;
  int stride_ = 1;
  std::vector<int> node_at_;
  std::vector<Node> nodes_;
  std::vector<SubsetMatch> matches_;
  std::vector<char> matched_;
};

}  // namespace sole::recon
