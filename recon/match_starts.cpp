#include "recon/match_starts.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

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

}  // namespace sole::recon
