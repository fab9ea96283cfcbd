#include "app/fit_feet.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <optional>
#include <tuple>
#include <unordered_map>
#include <utility>

#include <Eigen/Geometry>

namespace sole::app {
namespace {

using Indices = std::vector<std::size_t>;

PointCloud Pick(const PointCloud& cloud, const Indices& which) {
  PointCloud picked;
  for (const std::size_t i : which) {
    picked.points_m.push_back(cloud.points_m[i]);
    if (!cloud.normals.empty()) picked.normals.push_back(cloud.normals[i]);
    if (!cloud.sigma_m.empty()) picked.sigma_m.push_back(cloud.sigma_m[i]);
    if (!cloud.intensity.empty()) picked.intensity.push_back(cloud.intensity[i]);
    if (!cloud.pair.empty()) picked.pair.push_back(cloud.pair[i]);
  }
  return picked;
}

/// Points in cells that touch, largest piece first.
std::vector<Indices> Components(const PointCloud& cloud, double cell_m) {
  const auto key = [](const Eigen::Array3i& c) {
    return (std::int64_t{c.x()} << 42) ^ ((std::int64_t{c.y()} & 0x1fffff) << 21) ^ (std::int64_t{c.z()} & 0x1fffff);
  };
  std::vector<Eigen::Array3i> cells;
  std::vector<Indices> members;
  std::unordered_map<std::int64_t, int> number;
  for (std::size_t i = 0; i < cloud.Size(); ++i) {
    const Eigen::Vector3f& p = cloud.points_m[i];
    if (!p.allFinite() || p.cwiseAbs().maxCoeff() > 100) continue;
    const Eigen::Array3i cell = (p.cast<double>() / cell_m).array().floor().cast<int>();
    const auto [at, fresh] = number.emplace(key(cell), static_cast<int>(cells.size()));
    if (fresh) cells.push_back(cell), members.emplace_back();
    members[static_cast<std::size_t>(at->second)].push_back(i);
  }
  std::vector<int> root(cells.size());
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](int i) {
    while (root[static_cast<std::size_t>(i)] != i) i = root[static_cast<std::size_t>(i)] = root[static_cast<std::size_t>(root[static_cast<std::size_t>(i)])];
    return i;
  };
  for (std::size_t c = 0; c < cells.size(); ++c) {
    for (int k = 0; k < 27; ++k) {
      const auto near = number.find(key(cells[c] + Eigen::Array3i(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1)));
      if (near == number.end()) continue;
      const int a = find(static_cast<int>(c)), b = find(near->second);
      root[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
    }
  }
  std::vector<Indices> pieces;
  std::vector<int> piece_of(cells.size(), -1);
  for (std::size_t c = 0; c < cells.size(); ++c) {
    int& piece = piece_of[static_cast<std::size_t>(find(static_cast<int>(c)))];
    if (piece < 0) piece = static_cast<int>(pieces.size()), pieces.emplace_back();
    Indices& to = pieces[static_cast<std::size_t>(piece)];
    to.insert(to.end(), members[c].begin(), members[c].end());
  }
  std::stable_sort(pieces.begin(), pieces.end(), [](const Indices& a, const Indices& b) { return a.size() > b.size(); });
  return pieces;
}

/// Seen from above: the outline of the whole piece, and its lowest points.
struct Footprint {
  Eigen::AlignedBox2d box;
  std::vector<Eigen::Vector2d> low;
};

Footprint FootprintOf(const PointCloud& cloud, const Indices& piece, double low_m) {
  Footprint footprint;
  float lowest = std::numeric_limits<float>::infinity();
  for (const std::size_t i : piece) lowest = std::min(lowest, cloud.points_m[i].z());
  for (const std::size_t i : piece) {
    const Eigen::Vector2d p = cloud.points_m[i].head<2>().cast<double>();
    footprint.box.extend(p);
    if (cloud.points_m[i].z() < lowest + static_cast<float>(low_m)) footprint.low.push_back(p);
  }
  return footprint;
}

/// Whether points fit into a rectangle of a foot's size in some direction.
bool FitsOneFoot(const std::vector<Eigen::Vector2d>& a, const std::vector<Eigen::Vector2d>& b, const FeetOptions& options) {
  for (int degrees = 0; degrees < 180; degrees += 5) {
    const Eigen::Matrix2d turn = Eigen::Rotation2Dd(degrees * M_PI / 180).toRotationMatrix();
    Eigen::AlignedBox2d box;
    for (const auto* points : {&a, &b}) {
      for (const Eigen::Vector2d& p : *points) box.extend(Eigen::Vector2d(turn * p));
    }
    if (box.sizes().x() <= options.foot_length_m && box.sizes().y() <= options.foot_width_m) return true;
  }
  return false;
}

bool OneFoot(const Footprint& a, const Footprint& b, const FeetOptions& options) {
  const Eigen::AlignedBox2d both = a.box.intersection(b.box);
  if (!both.isEmpty() && both.volume() > 0.5 * std::min(a.box.volume(), b.box.volume())) return true;
  return FitsOneFoot(a.low, b.low, options);
}

/// The upright plane that parts a piece larger than one foot into two feet through as few of its low points as possible: those
/// of two feet that nearly touch, or do. None where no plane leaves a foot's outline on both sides.
std::optional<Eigen::Hyperplane<double, 2>> CutBetweenFeet(const std::vector<Eigen::Vector2d>& low, const FeetOptions& options) {
  constexpr double kCell_m = 0.002, kLeastShare = 0.25;
  std::optional<Eigen::Hyperplane<double, 2>> best;
  std::size_t fewest = low.size() / 20;  // more would cut through a foot
  for (int degrees = 0; degrees < 180; degrees += 3) {
    const Eigen::Vector2d normal = Eigen::Rotation2Dd(degrees * M_PI / 180) * Eigen::Vector2d::UnitX();
    Eigen::AlignedBox1d range;
    for (const Eigen::Vector2d& p : low) range.extend(Eigen::AlignedBox1d::VectorType(p.dot(normal)));
    const double begin = range.min()[0];
    std::vector<std::size_t> counts(static_cast<std::size_t>((range.max()[0] - begin) / kCell_m) + 1);
    for (const Eigen::Vector2d& p : low) ++counts[static_cast<std::size_t>((p.dot(normal) - begin) / kCell_m)];
    std::size_t before = 0;
    for (std::size_t k = 0; k < counts.size(); before += counts[k++]) {
      const std::size_t after = low.size() - before - counts[k];
      if (counts[k] >= fewest || static_cast<double>(std::min(before, after)) < kLeastShare * static_cast<double>(low.size())) continue;
      const Eigen::Hyperplane<double, 2> plane(normal, -(begin + (static_cast<double>(k) + 0.5) * kCell_m));
      std::vector<Eigen::Vector2d> sides[2];
      for (const Eigen::Vector2d& p : low) sides[plane.signedDistance(p) > 0].push_back(p);
      if (!FitsOneFoot(sides[0], {}, options) || !FitsOneFoot(sides[1], {}, options)) continue;
      fewest = counts[k];
      best = plane;
    }
  }
  return best;
}

/// Pieces that hold two feet cut into two.
std::vector<Indices> CutApart(const PointCloud& cloud, std::vector<Indices> pieces, const FeetOptions& options) {
  std::vector<Indices> parts;
  for (Indices& piece : pieces) {
    std::optional<Eigen::Hyperplane<double, 2>> cut;
    if (piece.size() >= 2 * options.min_points) {
      const Footprint print = FootprintOf(cloud, piece, options.low_m);
      if (!FitsOneFoot(print.low, {}, options)) cut = CutBetweenFeet(print.low, options);
    }
    if (!cut) {
      parts.push_back(std::move(piece));
      continue;
    }
    Indices sides[2];
    for (const std::size_t i : piece) sides[cut->signedDistance(cloud.points_m[i].head<2>().cast<double>()) > 0].push_back(i);
    for (Indices& side : sides) parts.push_back(std::move(side));
  }
  std::stable_sort(parts.begin(), parts.end(), [](const Indices& a, const Indices& b) { return a.size() > b.size(); });
  return parts;
}

double BoxDistance(const Eigen::AlignedBox2d& a, const Eigen::AlignedBox2d& b) {
  return std::sqrt(a.squaredExteriorDistance(b));
}

Eigen::Vector3d MiddleOf(const PointCloud& cloud) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& p : cloud.points_m) sum += p.cast<double>();
  return sum / static_cast<double>(std::max<std::size_t>(cloud.Size(), 1));
}

}  // namespace

std::vector<PointCloud> SplitFeet(const PointCloud& cloud, const FeetOptions& options) {
  const std::vector<Indices> pieces = CutApart(cloud, Components(cloud, options.cell_m), options);
  struct Foot {
    Indices points;
    Footprint print;
  };
  std::vector<Foot> feet;
  std::vector<const Indices*> small;
  for (const Indices& piece : pieces) {
    if (piece.size() < options.min_points) {
      small.push_back(&piece);
      continue;
    }
    const Footprint print = FootprintOf(cloud, piece, options.low_m);
    const auto same = std::find_if(feet.begin(), feet.end(), [&](const Foot& f) { return OneFoot(f.print, print, options); });
    if (same == feet.end()) {
      feet.push_back({piece, print});
    } else {
      same->points.insert(same->points.end(), piece.begin(), piece.end());
      same->print = FootprintOf(cloud, same->points, options.low_m);
    }
  }
  // One thing: nothing to tell apart, and small pieces may be parts of it.
  if (feet.size() < 2) return {cloud};
  for (const Indices* piece : small) {
    const Footprint print = FootprintOf(cloud, *piece, options.low_m);
    const auto nearest = std::min_element(feet.begin(), feet.end(), [&](const Foot& a, const Foot& b) {
      return BoxDistance(a.print.box, print.box) < BoxDistance(b.print.box, print.box);
    });
    if (BoxDistance(nearest->print.box, print.box) > options.attach_m) continue;
    nearest->points.insert(nearest->points.end(), piece->begin(), piece->end());
  }
  std::stable_sort(feet.begin(), feet.end(), [](const Foot& a, const Foot& b) { return a.points.size() > b.points.size(); });
  std::vector<PointCloud> clouds;
  for (Foot& foot : feet) {
    std::sort(foot.points.begin(), foot.points.end());
    clouds.push_back(Pick(cloud, foot.points));
  }
  return clouds;
}

std::vector<FootTrack> TrackFeet(std::span<const PointCloud> clouds, const FeetOptions& options) {
  std::vector<FootTrack> tracks;
  std::vector<Eigen::Vector3d> last;  // place of each track's last cloud
  for (std::size_t f = 0; f < clouds.size(); ++f) {
    std::vector<PointCloud> feet = SplitFeet(clouds[f], options);
    std::vector<Eigen::Vector3d> places;
    for (const PointCloud& foot : feet) places.push_back(MiddleOf(foot));
    std::vector<std::tuple<double, std::size_t, std::size_t>> pairs;
    for (std::size_t t = 0; t < tracks.size(); ++t) {
      if (tracks[t].End() != f) continue;
      for (std::size_t k = 0; k < feet.size(); ++k) {
        const double distance = (places[k] - last[t]).norm();
        if (feet[k].Size() >= options.min_points && distance <= options.step_m) pairs.emplace_back(distance, t, k);
      }
    }
    std::sort(pairs.begin(), pairs.end());
    std::vector<bool> taken(feet.size(), false);
    for (const auto& [distance, t, k] : pairs) {
      if (taken[k] || tracks[t].End() != f) continue;
      taken[k] = true;
      tracks[t].points += feet[k].Size();
      tracks[t].clouds.push_back(std::move(feet[k]));
      last[t] = places[k];
    }
    for (std::size_t k = 0; k < feet.size(); ++k) {
      if (taken[k] || feet[k].Size() < options.min_points) continue;
      tracks.push_back({f, {}, feet[k].Size()});
      tracks.back().clouds.push_back(std::move(feet[k]));
      last.push_back(places[k]);
    }
  }
  return tracks;
}

}  // namespace sole::app
