#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/error.h"
#include "recon/nearest_internal.h"

namespace sole::recon {
namespace {

using Cell = Eigen::Matrix<std::int64_t, 3, 1>;

constexpr int kMaxReach = 8;  // cells; a lonely point is compared with all others

struct Candidate {
  Eigen::Vector3d point;
  int index;
};

/// Points sorted into cubes.
class CellGrid {
 public:
  CellGrid(std::span<const Eigen::Vector3d> points, double cell_m)
      : points_(points), cell_m_(cell_m), entries_(points.size()) {
    tbb::parallel_for(std::size_t{0}, points.size(), [&](std::size_t i) {
      entries_[i] = {Key(CellOf(points[i])), static_cast<int>(i)};
    });
    tbb::parallel_sort(entries_.begin(), entries_.end());
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      if (i == 0 || entries_[i].key != entries_[i - 1].key) first_.push_back(i);
    }
    first_.push_back(entries_.size());
  }

  std::size_t Cells() const { return first_.size() - 1; }
  std::size_t Size(std::size_t cell) const { return first_[cell + 1] - first_[cell]; }
  int Point(std::size_t cell, std::size_t at) const { return entries_[first_[cell] + at].point; }

  void All(std::vector<Candidate>& points) const {
    points.clear();
    for (const Entry& entry : entries_) Add(entry.point, points);
  }

  /// Points in the cells at most `reach` away from a cell.
  void Gather(std::size_t cell, int reach, std::vector<Candidate>& points) const {
    points.clear();
    const Cell centre = CellOf(points_[static_cast<std::size_t>(Point(cell, 0))]);
    for (std::int64_t x = -reach; x <= reach; ++x) {
      for (std::int64_t y = -reach; y <= reach; ++y) {
        // Cells over each other follow each other.
        const std::uint64_t low = Key(centre + Cell(x, y, -reach)),
                            high = Key(centre + Cell(x, y, reach));
        auto at = std::lower_bound(entries_.begin(), entries_.end(), Entry{low, -1});
        for (; at != entries_.end() && at->key <= high; ++at) Add(at->point, points);
      }
    }
  }

 private:
  struct Entry {
    std::uint64_t key;
    int point;
    bool operator<(const Entry& other) const {
      return key != other.key ? key < other.key : point < other.point;
    }
  };

  void Add(int point, std::vector<Candidate>& points) const {
    points.push_back({points_[static_cast<std::size_t>(point)], point});
  }
  Cell CellOf(const Eigen::Vector3d& p) const {
    return (p / cell_m_).array().floor().cast<std::int64_t>();
  }
  static std::uint64_t Key(const Cell& cell) {
    constexpr std::int64_t kOffset = 1 << 20;
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis)
      key = (key << 21) | static_cast<std::uint64_t>(std::clamp<std::int64_t>(
                              cell[axis] + kOffset, 0, 2 * kOffset - 1));
    return key;
  }

  std::span<const Eigen::Vector3d> points_;
  double cell_m_;
  std::vector<Entry> entries_;
  std::vector<std::size_t> first_;  ///< entry of each cell, and the end
};

bool Nearer(const NearPoint& a, const NearPoint& b) {
  return a.squared_m2 != b.squared_m2 ? a.squared_m2 < b.squared_m2 : a.index < b.index;
}

}  // namespace

void ForNearest(std::span<const Eigen::Vector3d> points, int k, double cell_m,
                const std::function<void(int, std::span<const NearPoint>)>& f) {
  Require(k >= 1 && cell_m > 0, "nearest points: k and cell_m must be positive");
  const std::size_t wanted = std::min(static_cast<std::size_t>(k), points.size());
  const CellGrid grid(points, cell_m);
  tbb::parallel_for(std::size_t{0}, grid.Cells(), [&](std::size_t cell) {
    std::vector<Candidate> candidates;
    std::vector<NearPoint> near;
    std::vector<char> done(grid.Size(cell));
    std::size_t left = done.size();
    for (int reach = 1; left > 0; reach *= 2) {
      if (reach > kMaxReach) grid.All(candidates);
      else grid.Gather(cell, reach, candidates);
      if (candidates.size() < wanted) continue;
      // What was not gathered is further away than the cells reach.
      const bool all = candidates.size() == points.size();
      const double radius_m = all ? std::numeric_limits<double>::infinity() : reach * cell_m;
      for (std::size_t n = 0; n < done.size(); ++n) {
        if (done[n]) continue;
        const int i = grid.Point(cell, n);
        const Eigen::Vector3d& centre = points[static_cast<std::size_t>(i)];
        near.clear();
        for (const Candidate& c : candidates) {
          const double squared_m2 = (c.point - centre).squaredNorm();
          if (squared_m2 <= radius_m * radius_m) near.push_back({squared_m2, c.index});
        }
        if (near.size() < wanted) continue;
        std::nth_element(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(wanted) - 1,
                         near.end(), Nearer);
        f(i, std::span(near).first(wanted));
        done[n] = 1;
        --left;
      }
    }
  });
}

}  // namespace sole::recon
