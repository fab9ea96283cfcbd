#include "sim/skin_projection.h"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

namespace sole::sim {
namespace {

constexpr double kShortlistRadius = 0.004;

/// A shortlist and where it is valid; neighbouring points share it.
struct Vicinity {
  ImplicitFoot::Shortlist shortlist;
  Eigen::Vector3d centre = Eigen::Vector3d::Constant(1e3);

  const ImplicitFoot::Shortlist& At(const ImplicitFoot& foot, const Eigen::Vector3d& point) {
    if ((point - centre).squaredNorm() > kShortlistRadius * kShortlistRadius) {
      centre = point;
      foot.MakeShortlist(centre, kShortlistRadius, shortlist);
    }
    return shortlist;
  }
};

Eigen::Vector3d Project(const ImplicitFoot& foot, const Eigen::Vector3d& start, SkinKind kind, int chart,
                        Vicinity& vicinity) {
  const Eigen::Vector3d& normal = foot.Table().cut_normal;
  Eigen::Vector3d point = start;
  if (kind != SkinKind::kSkin) point -= normal * normal.dot(point - foot.Table().cut_point);
  if (kind == SkinKind::kCap) return point;
  for (int i = 0; i < 12; ++i) {
    const ImplicitFoot::Sample sample = foot.Evaluate(point, chart, vicinity.At(foot, point));
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
  Vicinity vicinity;
  return Project(foot, point, kind, chart, vicinity);
}

void ProjectAllToSkin(const ImplicitFoot& foot, std::span<const SkinKind> kinds, std::span<const std::uint8_t> charts,
                      std::span<Eigen::Vector3d> points) {
  constexpr std::size_t kChunk = 512;  // fixed, so that the result does not depend on the number of threads
  tbb::parallel_for(std::size_t{0}, (points.size() + kChunk - 1) / kChunk, [&](std::size_t chunk) {
    Vicinity vicinity;
    for (std::size_t i = chunk * kChunk; i < std::min(points.size(), (chunk + 1) * kChunk); ++i) {
      points[i] = Project(foot, points[i], kinds[i], charts[i], vicinity);
    }
  });
}

}  // namespace sole::sim
