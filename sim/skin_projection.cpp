#include "sim/skin_projection.h"

#include <algorithm>
#include <cmath>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

namespace sole::sim {
namespace {

constexpr double kShortlistRadius = 0.004;

Eigen::Vector3d Project(const ImplicitFoot& foot, const Eigen::Vector3d& start, SkinKind kind, int chart,
                        ImplicitFoot::Shortlist& shortlist) {
  const Eigen::Vector3d& normal = foot.Table().cut_normal;
  Eigen::Vector3d point = start;
  if (kind != SkinKind::kSkin) point -= normal * normal.dot(point - foot.Table().cut_point);
  if (kind == SkinKind::kCap) return point;
  Eigen::Vector3d centre = point;
  foot.MakeShortlist(centre, kShortlistRadius, shortlist);
  for (int i = 0; i < 12; ++i) {
    if ((point - centre).norm() > kShortlistRadius) {
      centre = point;
      foot.MakeShortlist(centre, kShortlistRadius, shortlist);
    }
    const ImplicitFoot::Sample sample = foot.Evaluate(point, chart, shortlist);
    if (std::abs(sample.value) < 2e-7) break;
    Eigen::Vector3d direction = sample.gradient;
    if (kind == SkinKind::kRim) direction -= normal * normal.dot(direction);
    const double squared = std::max(direction.squaredNorm(), 0.05);
    Eigen::Vector3d step = -sample.value / squared * direction;
    const double length = step.norm();
    if (length > 0.003) step *= 0.003 / length;
    point += step;
  }
  return point;
}

}  // namespace

Eigen::Vector3d ProjectToSkin(const ImplicitFoot& foot, const Eigen::Vector3d& point, SkinKind kind, int chart) {
  ImplicitFoot::Shortlist shortlist;
  return Project(foot, point, kind, chart, shortlist);
}

void ProjectAllToSkin(const ImplicitFoot& foot, std::span<const SkinKind> kinds, std::span<const std::uint8_t> charts,
                      std::span<Eigen::Vector3d> points) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, points.size(), 512), [&](const auto& range) {
    ImplicitFoot::Shortlist shortlist;
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      points[i] = Project(foot, points[i], kinds[i], charts[i], shortlist);
    }
  });
}

}  // namespace sole::sim
