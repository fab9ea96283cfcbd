#include "contact/label.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <unordered_map>
#include <vector>

#include <Eigen/Dense>
#include <fmt/format.h>

#include "contact/ground.h"
#include "core/error.h"

namespace sole::contact {
namespace {

/// A point of the scan's underside: its place and its height over the local glass.
struct SolePoint {
  Eigen::Vector2d place;
  double gap_m = 0;
  double touching = 0;  ///< probability that its gap is below kContactGap_m
};

/// Points of the underside near the glass, in cells as large as the reach.
class SolePoints {
 public:
  SolePoints(const PointCloud& scan, const GroundPlane& ground, const GroundSurface& calibrated, const LabelOptions& options)
      : cell_m_(options.reach_m) {
    for (std::size_t i = 0; i < scan.Size(); ++i) {
      // Skin that looks down, or to the side as at the heel's edge.
      if (!scan.points_m[i].allFinite() || (!scan.normals.empty() && scan.normals[i].z() > -0.3F)) continue;
      const Eigen::Vector3d p = scan.points_m[i].cast<double>();
      const double gap = Gap(ground, p, calibrated);
      if (gap > 2 * options.near_m) continue;
      const double sigma = std::max(std::hypot(scan.sigma_m.empty() ? 0 : scan.sigma_m[i], ground.sigma_m), 1e-9);
      cells_[Key(Cell(p.x()), Cell(p.y()))].push_back(
          {p.head<2>(), gap, 0.5 * std::erfc((gap - kContactGap_m) / (sigma * std::sqrt(2.0)))});
    }
  }

  template <typename Visit>
  void Around(const Eigen::Vector2d& place, const Visit& visit) const {
    for (int k = 0; k < 9; ++k) {
      const auto found = cells_.find(Key(Cell(place.x()) + k % 3 - 1, Cell(place.y()) + k / 3 - 1));
      if (found == cells_.end()) continue;
      for (const SolePoint& point : found->second) {
        const double distance2 = (point.place - place).squaredNorm();
        if (distance2 < cell_m_ * cell_m_) visit(point, distance2);
      }
    }
  }

 private:
  int Cell(double x) const { return static_cast<int>(std::floor(x / cell_m_)); }
  static std::int64_t Key(int x, int y) { return (std::int64_t{x} << 32) ^ (std::int64_t{y} & 0xffffffff); }
  double cell_m_;
  std::unordered_map<std::int64_t, std::vector<SolePoint>> cells_;
};

/// The skin around one vertex.
struct Around {
  double share = 0;      ///< of it that touches
  double points = 0;     ///< that say so, weighted
  std::optional<double> gap_m;
};

Around LookAround(const SolePoints& sole, const Eigen::Vector2d& place, const LabelOptions& options) {
  Around around;
  // Height of the skin: a + b x + c y + d x^2 + e x y + f y^2, curvature held back a little where points are few.
  Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Identity() * 1e-9;
  Eigen::Matrix<double, 6, 1> right = Eigen::Matrix<double, 6, 1>::Zero();
  double touching = 0, weights = 0;
  sole.Around(place, [&](const SolePoint& point, double distance2) {
    const double near = std::exp(-0.5 * distance2 / (options.tangential_sd_m * options.tangential_sd_m));
    around.points += near;
    touching += near * point.touching;
    const double w = std::exp(-0.5 * distance2 / (options.patch_sd_m * options.patch_sd_m));
    const Eigen::Vector2d q = (point.place - place) / options.patch_sd_m;
    const Eigen::Matrix<double, 6, 1> row(1, q.x(), q.y(), q.x() * q.x(), q.x() * q.y(), q.y() * q.y());
    normal += w * row * row.transpose();
    right += w * point.gap_m * row;
    weights += w;
  });
  if (around.points > 0) around.share = touching / around.points;
  if (weights < 2) return around;
  constexpr double kHeldBack = 0.05;
  normal.diagonal().tail<3>().array() += kHeldBack * weights;
  around.gap_m = normal.ldlt().solve(right)[0];
  return around;
}

}  // namespace

std::vector<VertexEvidence> GatherEvidence(const SkinEvidence& skin, const GroundPlane& ground, const GroundSurface& calibrated,
                                           const LabelOptions& options) {
  const Eigen::Index n = skin.registered_m.rows();
  Require(skin.registered_sd_m.size() == n && skin.undeformed_m.rows() == n,
          fmt::format("contact: {} registered vertices, {} standard deviations, {} vertices of the model", n,
                      skin.registered_sd_m.size(), skin.undeformed_m.rows()));
  constexpr double kDeepest_m = 0.004, kHighest_m = 0.002, kFewest = 0.5, kNever = 0.03;
  const auto scaled = [](double gap_m) { return std::asinh((gap_m - kContactGap_m) / kContactGap_m); };
  const SolePoints sole(skin.scan, ground, calibrated, options);
  std::vector<VertexEvidence> evidence(static_cast<std::size_t>(n));
  for (Eigen::Index i = 0; i < n; ++i) {
    VertexEvidence& at = evidence[static_cast<std::size_t>(i)];
    const Eigen::Vector3d vertex = skin.registered_m.row(i).transpose();
    at.gap_m = std::nan("");
    if (!vertex.allFinite()) continue;
    at.gap_m = Gap(ground, vertex, calibrated);
    if (at.gap_m < options.near_m) {
      const Around around = LookAround(sole, vertex.head<2>(), options);
      if (around.gap_m) at.gap_m = *around.gap_m;
      if (around.points >= kFewest) {
        at.share = std::log((around.share + kNever) / (1 - around.share + kNever));
        if (around.gap_m) at.gap = scaled(*around.gap_m);
      }
    } else {
      at.gap = scaled(at.gap_m);
    }
    at.depth_m = std::clamp(Gap(ground, skin.undeformed_m.row(i).transpose(), calibrated), -kDeepest_m, kHighest_m);
    at.sd_m = std::hypot(skin.registered_sd_m[i], ground.sigma_m);
  }
  return evidence;
}

FrameContact LabelContact(const SkinEvidence& skin, const GroundPlane& ground, const GroundSurface& calibrated,
                          const LabelOptions& options) {
  const std::vector<VertexEvidence> evidence = GatherEvidence(skin, ground, calibrated, options);
  const auto n = static_cast<Eigen::Index>(evidence.size());
  FrameContact labels;
  labels.contact.assign(evidence.size(), 0);
  labels.probability = Eigen::VectorXd::Zero(n);
  labels.gap_m = Eigen::VectorXd::Constant(n, std::nan(""));
  for (Eigen::Index i = 0; i < n; ++i) {
    const VertexEvidence& at = evidence[static_cast<std::size_t>(i)];
    if (std::isnan(at.gap_m)) continue;
    labels.gap_m[i] = at.gap_m;
    double odds = options.odds + options.odds_share * at.share + options.odds_gap * at.gap + options.odds_depth_per_m * at.depth_m;
    // A vertex that the scan does not hold: odds over its deviation's spread (MacKay's approximation of the mean logistic).
    const double spread = options.odds_depth_per_m * at.sd_m;
    odds /= std::sqrt(1 + M_PI / 8 * spread * spread);
    labels.probability[i] = 1 / (1 + std::exp(-odds));
    labels.contact[static_cast<std::size_t>(i)] = odds > 0;
  }
  return labels;
}

}  // namespace sole::contact
