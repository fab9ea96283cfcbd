#include "recon/fuse.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>

#include "core/error.h"
#include "recon/nearest_internal.h"
#include "recon/pair_offsets.h"

namespace sole::recon {
namespace {

/// Weighted sum of points of one pair in one voxel.
struct Merged {
  Eigen::Vector3d point_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d to_camera = Eigen::Vector3d::Zero();
  double weight = 0;   ///< sum of inverse variances
  double sigma_m = 0;  ///< along the ray
  double intensity = 0;
  int pair = 0;
  int count = 0;
};

std::uint64_t VoxelKey(const Eigen::Vector3d& p, double voxel_m) {
  constexpr std::int64_t kOffset = 1 << 20;
  std::uint64_t key = 0;
  for (int axis = 0; axis < 3; ++axis) {
    const std::int64_t cell = static_cast<std::int64_t>(std::floor(p[axis] / voxel_m)) + kOffset;
    key = (key << 21) | (static_cast<std::uint64_t>(cell) & 0x1FFFFF);
  }
  return key;
}

/// Mean of the points of one pair in a voxel. Their windows overlap, so sigma does not shrink.
Merged MergePair(std::span<const PairPoint> points, std::span<const std::uint32_t> group) {
  Merged merged;
  double sigma = 0;
  for (const std::uint32_t i : group) {
    const PairPoint& p = points[i];
    const double w = 1 / (p.ray_sigma_m * p.ray_sigma_m);
    merged.point_m += w * p.point_m;
    merged.to_camera += w * p.to_camera;
    merged.intensity += w * static_cast<double>(p.intensity);
    sigma += w * p.ray_sigma_m;
    merged.weight += w;
    merged.pair = p.pair;
    ++merged.count;
  }
  merged.point_m /= merged.weight;
  merged.intensity /= merged.weight;
  merged.sigma_m = sigma / merged.weight;
  merged.weight = 1 / (merged.sigma_m * merged.sigma_m);
  merged.to_camera.normalize();
  return merged;
}

/// Mean over pairs where they agree; otherwise each stays for itself.
void MergePairs(std::vector<Merged>& of_voxel, double max_disagreement_m,
                std::vector<Merged>& out) {
  std::sort(of_voxel.begin(), of_voxel.end(),
            [](const Merged& a, const Merged& b) { return a.weight > b.weight; });
  Merged& best = of_voxel.front();
  const Eigen::Vector3d reference = best.point_m;
  double total = best.weight;
  Eigen::Vector3d sum = best.weight * best.point_m;
  for (std::size_t i = 1; i < of_voxel.size(); ++i) {
    const Merged& other = of_voxel[i];
    const Eigen::Vector3d off = other.point_m - reference;
    if (std::abs(off.dot(best.to_camera)) > max_disagreement_m ||
        other.to_camera.dot(best.to_camera) < -0.5) {
      out.push_back(other);
      continue;
    }
    sum += other.weight * other.point_m;
    total += other.weight;
  }
  best.point_m = sum / total;
  best.sigma_m = 1 / std::sqrt(total);
  out.push_back(best);
}

/// Means per voxel and pair, voxel after voxel.
struct VoxelMeans {
  std::vector<Merged> means;
  std::vector<std::size_t> first;  ///< of every voxel, and the end
};

VoxelMeans MergeWithinPairs(std::span<const PairPoint> points, const FuseOptions& options) {
  std::vector<std::uint64_t> keys(points.size());
  tbb::parallel_for(std::size_t{0}, points.size(),
                    [&](std::size_t i) { keys[i] = VoxelKey(points[i].point_m, options.voxel_m); });
  std::vector<std::uint32_t> order(points.size());
  std::iota(order.begin(), order.end(), 0U);
  tbb::parallel_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    if (keys[a] != keys[b]) return keys[a] < keys[b];
    if (points[a].pair != points[b].pair) return points[a].pair < points[b].pair;
    return a < b;
  });
  VoxelMeans voxels;
  for (std::size_t begin = 0; begin < order.size();) {
    const std::uint64_t key = keys[order[begin]];
    voxels.first.push_back(voxels.means.size());
    while (begin < order.size() && keys[order[begin]] == key) {
      std::size_t stop = begin;
      while (stop < order.size() && keys[order[stop]] == key &&
             points[order[stop]].pair == points[order[begin]].pair) {
        ++stop;
      }
      voxels.means.push_back(MergePair(points, std::span(order).subspan(begin, stop - begin)));
      begin = stop;
    }
  }
  voxels.first.push_back(voxels.means.size());
  return voxels;
}

/// Offsets of the pairs along their rays, from places that they share. `normals`: per voxel.
std::vector<double> MeasureOffsets(const VoxelMeans& voxels,
                                   const std::vector<Eigen::Vector3d>& normals, int pairs,
                                   const FuseOptions& options) {
  std::vector<PairDifference> differences;
  std::vector<double> precision(static_cast<std::size_t>(pairs), 0.0);
  for (std::size_t v = 0; v + 1 < voxels.first.size(); ++v) {
    for (std::size_t i = voxels.first[v]; i < voxels.first[v + 1]; ++i) {
      const Merged& a = voxels.means[i];
      precision[static_cast<std::size_t>(a.pair)] += a.weight;
      for (std::size_t j = i + 1; j < voxels.first[v + 1]; ++j) {
        const Merged& b = voxels.means[j];
        // Along the normal the two points may lie at different places of the voxel.
        const double cos_a = normals[v].dot(a.to_camera), cos_b = normals[v].dot(b.to_camera);
        if (std::min(cos_a, cos_b) < options.min_offset_cosine) continue;
        const double along = 2 * normals[v].dot(a.point_m - b.point_m) / (cos_a + cos_b);
        if (std::abs(along) < 2 * options.voxel_m) differences.push_back({a.pair, b.pair, along});
      }
    }
  }
  return SolvePairOffsets(differences, precision);
}

/// Takes offsets away that matter and can be trusted; false if there are none.
bool MoveTogether(std::span<const double> offsets, const FuseOptions& options, VoxelMeans& voxels) {
  bool moved = false;
  for (Merged& mean : voxels.means) {
    const double offset_m = offsets[static_cast<std::size_t>(mean.pair)];
    if (std::abs(offset_m) > options.max_offset_m || std::abs(offset_m) < options.min_offset_m)
      continue;
    mean.point_m -= offset_m * mean.to_camera;
    moved = true;
  }
  return moved;
}

/// `best`, if given: the merged point of each voxel's most precise pair.
std::vector<Merged> MergeAcrossPairs(const VoxelMeans& voxels, const FuseOptions& options,
                                     std::vector<std::size_t>* best = nullptr) {
  std::vector<Merged> merged, of_voxel;
  merged.reserve(voxels.means.size());
  for (std::size_t v = 0; v + 1 < voxels.first.size(); ++v) {
    of_voxel.assign(voxels.means.begin() + static_cast<std::ptrdiff_t>(voxels.first[v]),
                    voxels.means.begin() + static_cast<std::ptrdiff_t>(voxels.first[v + 1]));
    MergePairs(of_voxel, options.max_disagreement_m, merged);
    if (best) best->push_back(merged.size() - 1);  // what disagrees with it comes before
  }
  return merged;
}

/// What the nearest points say of a point.
struct Neighbourhood {
  std::vector<int> near;  ///< within connect_m
  double mean_distance_m = 0;
  double plane_residual_m = 0;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
};

std::vector<Neighbourhood> FindNeighbourhoods(const std::vector<Merged>& points,
                                              const FuseOptions& options) {
  std::vector<Eigen::Vector3d> places;
  places.reserve(points.size());
  for (const Merged& p : points) places.push_back(p.point_m);
  std::vector<Neighbourhood> result(points.size());
  // A surface has about one merged point a voxel's square, a few more at most.
  const double reach_m = 0.6 * std::sqrt(static_cast<double>(options.neighbours)) * options.voxel_m;
  ForNearest(places, options.neighbours + 1, reach_m, [&](int at, std::span<const NearPoint> near) {
    const auto i = static_cast<std::size_t>(at);
    Neighbourhood& n = result[i];
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    for (const NearPoint& other : near) {
      const double d = std::sqrt(other.squared_m2);
      n.mean_distance_m += d;
      if (d < options.connect_m) n.near.push_back(other.index);
      mean += places[static_cast<std::size_t>(other.index)];
    }
    n.mean_distance_m /= std::max<double>(1, static_cast<double>(near.size()) - 1);
    mean /= static_cast<double>(near.size());
    Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
    for (const NearPoint& other : near) {
      const Eigen::Vector3d off = places[static_cast<std::size_t>(other.index)] - mean;
      scatter += off * off.transpose();
    }
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen;
    eigen.computeDirect(scatter);
    n.normal = eigen.eigenvectors().col(0).normalized();
    if (n.normal.dot(points[i].to_camera) < 0) n.normal = -n.normal;
    n.plane_residual_m = std::abs(n.normal.dot(points[i].point_m - mean));
  });
  return result;
}

std::vector<char> FindInliers(const std::vector<Neighbourhood>& around,
                              const FuseOptions& options) {
  double sum = 0, squares = 0;
  for (const Neighbourhood& n : around) {
    sum += n.mean_distance_m;
    squares += n.mean_distance_m * n.mean_distance_m;
  }
  const auto count = static_cast<double>(around.size());
  const double mean = sum / count;
  const double deviation = std::sqrt(std::max(0.0, squares / count - mean * mean));
  const double limit = mean + options.outlier_deviations * deviation;
  std::vector<char> inlier(around.size());
  for (std::size_t i = 0; i < around.size(); ++i) {
    inlier[i] = around[i].mean_distance_m <= limit &&
                around[i].plane_residual_m <= options.max_plane_residual_m;
  }
  return inlier;
}

/// Component number of every inlier (-1 for others); neighbours within connect_m are connected.
std::vector<int> FindComponents(const std::vector<Neighbourhood>& around,
                                const std::vector<char>& inlier, int& components) {
  std::vector<int> parent(around.size());
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int i) {
    while (parent[static_cast<std::size_t>(i)] != i) {
      auto& p = parent[static_cast<std::size_t>(i)];
      p = parent[static_cast<std::size_t>(p)];
      i = p;
    }
    return i;
  };
  for (std::size_t i = 0; i < around.size(); ++i) {
    if (!inlier[i]) continue;
    for (const int j : around[i].near) {
      if (!inlier[static_cast<std::size_t>(j)]) continue;
      const int a = root(static_cast<int>(i)), b = root(j);
      parent[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }
  }
  std::vector<int> component(around.size(), -1);
  components = 0;
  for (std::size_t i = 0; i < around.size(); ++i) {
    if (!inlier[i]) continue;
    const auto r = static_cast<std::size_t>(root(static_cast<int>(i)));
    component[i] = r == i ? components++ : component[r];
  }
  return component;
}

using Footprint = Eigen::AlignedBox2d;

/// Whether one stands over the other: half of the smaller footprint is shared.
bool SameFoot(const Footprint& a, const Footprint& b) {
  const Footprint both = a.intersection(b);
  return !both.isEmpty() && both.volume() > 0.5 * std::min(a.volume(), b.volume());
}

/// Number of the foot that every component belongs to, largest first; -1 for others. Parts that no
/// pair joins (the back of a foot and its sole, say) are one foot where they stand over each other.
std::vector<int> FeetOf(const std::vector<int>& size, const std::vector<char>& is_foot,
                        const std::vector<Footprint>& footprints) {
  std::vector<std::size_t> parts;
  for (std::size_t c = 0; c < size.size(); ++c) {
    if (is_foot[c]) parts.push_back(c);
  }
  std::stable_sort(parts.begin(), parts.end(),
                   [&](std::size_t a, std::size_t b) { return size[a] > size[b]; });
  std::vector<int> foot(size.size(), -1);
  std::vector<Footprint> feet;
  for (const std::size_t c : parts) {
    std::size_t k = 0;
    while (k < feet.size() && !SameFoot(feet[k], footprints[c])) ++k;
    if (k == feet.size()) feet.emplace_back();
    feet[k].extend(footprints[c]);
    foot[c] = static_cast<int>(k);
  }
  return foot;
}

void AddToPiece(const Eigen::Vector3d& point_m, int number, FusedClouds& result) {
  result.piece.push_back(static_cast<std::uint8_t>(number));
  if (static_cast<std::size_t>(number) >= result.pieces.size())
    result.pieces.resize(static_cast<std::size_t>(number) + 1);
  CloudPiece& piece = result.pieces[static_cast<std::size_t>(number)];
  piece.min_m = piece.points == 0 ? point_m : Eigen::Vector3d(piece.min_m.cwiseMin(point_m));
  piece.max_m = piece.points == 0 ? point_m : Eigen::Vector3d(piece.max_m.cwiseMax(point_m));
  ++piece.points;
}

void Append(const Merged& point, const Eigen::Vector3d& normal, PointCloud& cloud) {
  // Moving along the ray moves the surface along its normal by the cosine between them.
  const double cosine = std::max(0.1, normal.dot(point.to_camera));
  cloud.points_m.push_back(point.point_m.cast<float>());
  cloud.normals.push_back(normal.cast<float>());
  cloud.sigma_m.push_back(static_cast<float>(point.sigma_m * cosine));
  cloud.intensity.push_back(static_cast<float>(point.intensity));
  cloud.pair.push_back(static_cast<std::uint8_t>(point.pair));
}

}  // namespace

FusedClouds Fuse(std::span<const PairPoint> points, int pairs, const FuseOptions& options) {
  Require(options.voxel_m > 1e-5 && options.neighbours >= 3,
          "fuse: voxel_m must exceed 0.01 mm and neighbours be at least 3");
  FusedClouds result;
  result.foot_points.assign(static_cast<std::size_t>(pairs), 0);
  result.offset_m.assign(static_cast<std::size_t>(pairs), 0);
  if (points.empty()) return result;
  VoxelMeans voxels = MergeWithinPairs(points, options);
  std::vector<std::size_t> best;
  std::vector<Merged> merged = MergeAcrossPairs(voxels, options, &best);
  std::vector<Neighbourhood> around = FindNeighbourhoods(merged, options);
  std::vector<Eigen::Vector3d> normals;
  for (const std::size_t i : best) normals.push_back(around[i].normal);
  result.offset_m = MeasureOffsets(voxels, normals, pairs, options);
  if (MoveTogether(result.offset_m, options, voxels)) {
    merged = MergeAcrossPairs(voxels, options);
    around = FindNeighbourhoods(merged, options);
  }
  const std::vector<char> inlier = FindInliers(around, options);
  int components = 0;
  const std::vector<int> component = FindComponents(around, inlier, components);

  std::vector<int> size(static_cast<std::size_t>(components)),
      high(static_cast<std::size_t>(components));
  std::vector<Footprint> footprints(static_cast<std::size_t>(components));
  for (std::size_t i = 0; i < merged.size(); ++i) {
    if (component[i] < 0) continue;
    const auto c = static_cast<std::size_t>(component[i]);
    ++size[c];
    footprints[c].extend(merged[i].point_m.head<2>());
    if (merged[i].point_m.z() > options.min_foot_height_m) ++high[c];
  }
  std::vector<char> is_foot(size.size());
  for (std::size_t c = 0; c < size.size(); ++c)
    is_foot[c] = size[c] >= options.min_component && 10 * high[c] > size[c];
  const std::vector<int> foot = FeetOf(size, is_foot, footprints);
  for (std::size_t i = 0; i < merged.size(); ++i) {
    const auto c = static_cast<std::size_t>(std::max(component[i], 0));
    if (component[i] < 0) {
      ++result.outliers;
    } else if (is_foot[c]) {
      Append(merged[i], around[i].normal, result.cloud);
      AddToPiece(merged[i].point_m, std::min(foot[c], 254), result);
      ++result.foot_points[static_cast<std::size_t>(merged[i].pair)];
    } else if (high[c] == 0 && std::abs(merged[i].point_m.z()) < options.platform_height_m) {
      Append(merged[i], Eigen::Vector3d::UnitZ(), result.platform);
    } else {
      ++result.outliers;
    }
  }
  return result;
}

}  // namespace sole::recon
