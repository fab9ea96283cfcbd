#include "sim/implicit_foot.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace sole::sim {
namespace {

using Sample = ImplicitFoot::Sample;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Cubic smooth minimum: C2, local (nothing changes where |a - b| >= k).
Sample SmoothMin(const Sample& a, const Sample& b, double k) {
  const double difference = b.value - a.value;
  if (!(std::abs(difference) < k)) return difference > 0 ? a : b;
  const double h = (k - std::abs(difference)) / k;
  const Sample& low = difference > 0 ? a : b;
  const Sample& high = difference > 0 ? b : a;
  const double share = 0.5 * h * h;
  return {low.value - h * h * h * k / 6, (1 - share) * low.gradient + share * high.gradient};
}

Sample Negated(const Sample& s) { return {-s.value, -s.gradient}; }

double Clamp01(double x) { return std::clamp(x, 0.0, 1.0); }

struct NailProfile {
  double height_mm = 0;
  double outline_mm = 0;  ///< distance outside the outline
  double slab = 0;
};

/// The readme's nail formula; q across, towards the tip and outwards in millimetres.
NailProfile ProfileOf(const Nail& nail, const Eigen::Vector3d& q) {
  NailProfile profile;
  profile.slab = 1 - Clamp01((std::abs(q.z()) - 4) / 2);
  if (profile.slab <= 0) return profile;
  const double half_width = nail.half_width * 1e3, half_length = nail.half_length * 1e3;
  const double s = std::pow(std::pow(std::abs(q.x() / half_width), nail.exponent) +
                                std::pow(std::abs(q.y() / half_length), nail.exponent),
                            1 / nail.exponent);
  const double outline = (s - 1) * std::min(half_width, half_length);
  profile.outline_mm = outline;
  if (outline > 4) return profile;
  const double groove_width = nail.groove_width * 1e3;
  const double ramp = Clamp01(0.5 - outline / 0.8);
  const double v = Clamp01((q.y() / half_length + 1) / 2);
  const double plate = nail.plate_height * 1e3 * (0.35 + 0.65 * v) * ramp * ramp * (3 - 2 * ramp);
  const double off_centre = (outline - 0.3 * groove_width) / groove_width;
  const double groove = nail.groove_depth * 1e3 * std::exp(-off_centre * off_centre) *
                        (1 - Clamp01((v - 0.75) / 0.2));
  profile.height_mm = profile.slab * (plate - groove);
  return profile;
}

}  // namespace

ImplicitFoot::ImplicitFoot(AnatomyTable table) : table_(std::move(table)) {
  for (const FleshPrimitive& p : table_.primitives) {
    if (p.is_cone) {
      const double length = std::max((p.b - p.a).norm(), 1e-6);
      const double sine = std::clamp((p.radius_a - p.radius_b) / length, -0.9, 0.9);
      shape_index_.push_back(static_cast<int>(cones_.size()));
      cones_.push_back({p.a, (p.b - p.a) / length, length, p.radius_a,
                        (p.radius_b - p.radius_a) / length, sine / std::sqrt(1 - sine * sine)});
    } else {
      const Eigen::Vector3d radii = p.half_axes.colwise().norm();
      shape_index_.push_back(static_cast<int>(ellipsoids_.size()));
      ellipsoids_.push_back({p.a, radii.cwiseInverse().asDiagonal() * p.half_axes.transpose(),
                             radii.cwiseInverse()});
    }
    all_.push_back(static_cast<std::uint16_t>(all_.size()));
  }
  reach_.assign(table_.primitives.size(), 0);
  std::array<double, kNumGroups> largest{};
  for (std::size_t i = table_.primitives.size(); i-- > 0;) {
    double& k = largest[static_cast<std::size_t>(table_.primitives[i].group)];
    k = std::max(k, table_.primitives[i].k);
    reach_[i] = k;
  }
}

Sample ImplicitFoot::PrimitiveDistance(std::size_t primitive, const Eigen::Vector3d& point) const {
  const auto index = static_cast<std::size_t>(shape_index_[primitive]);
  if (table_.primitives[primitive].is_cone) {
    const Cone& cone = cones_[index];
    const Eigen::Vector3d q = point - cone.start;
    const double y = q.dot(cone.direction);
    const double x = std::sqrt(std::max(q.squaredNorm() - y * y, 0.0));
    const double s = std::clamp(y - x * cone.tangent, 0.0, cone.length);
    const Eigen::Vector3d from_axis = q - s * cone.direction;
    const double distance = from_axis.norm();
    return {distance - (cone.radius_start + cone.slope * s), from_axis / std::max(distance, 1e-9)};
  }
  const Ellipsoid& ellipsoid = ellipsoids_[index];
  const Eigen::Vector3d q = ellipsoid.to_local * (point - ellipsoid.centre);
  const Eigen::Vector3d u = q.cwiseProduct(ellipsoid.inverse_radii);
  const Eigen::Vector3d w = u.cwiseProduct(ellipsoid.inverse_radii);
  const double k0 = std::max(u.norm(), 1e-3);
  const double k1 = std::max(w.norm(), 1e-4 * ellipsoid.inverse_radii.maxCoeff());
  const double value = k0 * (k0 - 1) / k1;
  const Eigen::Vector3d d_k0 = w / k0;
  const Eigen::Vector3d d_k1 =
      w.cwiseProduct(ellipsoid.inverse_radii).cwiseProduct(ellipsoid.inverse_radii) / k1;
  const Eigen::Vector3d local = ((2 * k0 - 1) * d_k0 - value * d_k1) / k1;
  return {value, ellipsoid.to_local.transpose() * local};
}

ImplicitFoot::Groups ImplicitFoot::BlendGroups(const Eigen::Vector3d& point,
                                               const Shortlist& shortlist) const {
  Groups groups;
  groups.fill({kInfinity, Eigen::Vector3d::Zero()});
  for (const std::uint16_t i : shortlist) {
    const FleshPrimitive& primitive = table_.primitives[i];
    Sample& group = groups[static_cast<std::size_t>(primitive.group)];
    const Sample sample = PrimitiveDistance(i, point);
    group = group.value == kInfinity ? sample : SmoothMin(group, sample, primitive.k);
  }
  return groups;
}

Sample ImplicitFoot::Join(const Groups& groups, int chart) const {
  constexpr double kFlattening = 0.0006;  // blend of a toe's round skin into its flattened side
  Sample toes{kInfinity, Eigen::Vector3d::Zero()};
  for (int toe = 1; toe < kNumGroups; ++toe) {
    if (chart != 0 && chart != toe) continue;
    const Sample& own = groups[static_cast<std::size_t>(toe)];
    if (own.value == kInfinity) continue;
    Sample other{kInfinity, Eigen::Vector3d::Zero()};
    for (int neighbour = 1; neighbour < kNumGroups; ++neighbour) {
      const Sample& sample = groups[static_cast<std::size_t>(neighbour)];
      if (neighbour != toe && sample.value < other.value) other = sample;
    }
    Sample kept = own;
    if (other.value < kInfinity) {
      const Sample side{0.5 * (own.value - other.value) + table_.toe_clearance,
                        0.5 * (own.gradient - other.gradient)};
      kept = Negated(SmoothMin(Negated(own), Negated(side), kFlattening));
    }
    if (kept.value < toes.value) toes = kept;
  }
  if (toes.value == kInfinity) return groups[kBodyGroup];
  if (groups[kBodyGroup].value == kInfinity) return toes;
  return SmoothMin(groups[kBodyGroup], toes, table_.k_body_toes);
}

Sample ImplicitFoot::NailTerm(const Eigen::Vector3d& point, int chart) const {
  Sample term;
  for (const Nail& nail : table_.nails) {
    if (chart != 0 && chart != nail.toe) continue;
    const Eigen::Vector3d offset = point - nail.centre;
    if (offset.squaredNorm() > 0.02 * 0.02) continue;
    const Eigen::Vector3d q = 1e3 * (nail.axes.transpose() * offset);
    const NailProfile profile = ProfileOf(nail, q);
    if (profile.slab <= 0 || profile.outline_mm > 4) continue;
    term.value -= 1e-3 * profile.height_mm;
    constexpr double kStep = 1e-4;
    Eigen::Vector3d slope;
    for (int j = 0; j < 3; ++j) {
      const Eigen::Vector3d step = kStep * Eigen::Vector3d::Unit(j);
      slope[j] = (ProfileOf(nail, q + step).height_mm - ProfileOf(nail, q - step).height_mm) / (2 * kStep);
    }
    term.gradient -= nail.axes * slope;
  }
  return term;
}

Sample ImplicitFoot::Evaluate(const Eigen::Vector3d& point, int chart) const {
  return Evaluate(point, chart, all_);
}

Sample ImplicitFoot::Evaluate(const Eigen::Vector3d& point, int chart, const Shortlist& shortlist) const {
  Sample sample = Join(BlendGroups(point, shortlist), chart);
  const Sample nails = NailTerm(point, chart);
  sample.value += nails.value;
  sample.gradient += nails.gradient;
  return sample;
}

void ImplicitFoot::MakeShortlist(const Eigen::Vector3d& point, double radius, Shortlist& shortlist) const {
  // Beyond this a group cannot reach the skin: blend of body and toes plus what blending lowers.
  const double group_reach = table_.k_body_toes + 0.009;
  constexpr double kSlack = 0.002;  // ellipsoid distances change a little faster than the point moves
  std::array<double, kNumGroups> nearest;
  nearest.fill(kInfinity);
  std::vector<double> distance(all_.size());
  for (std::size_t i = 0; i < all_.size(); ++i) {
    distance[i] = PrimitiveDistance(i, point).value;
    double& low = nearest[static_cast<std::size_t>(table_.primitives[i].group)];
    low = std::min(low, distance[i]);
  }
  const double lowest = *std::min_element(nearest.begin(), nearest.end());
  shortlist.clear();
  for (std::size_t i = 0; i < all_.size(); ++i) {
    const double low = nearest[static_cast<std::size_t>(table_.primitives[i].group)];
    if (low > lowest + group_reach + 2 * radius) continue;
    if (distance[i] < low + reach_[i] + 2 * radius + kSlack) shortlist.push_back(all_[i]);
  }
}

std::array<double, kNumGroups> ImplicitFoot::GroupDistances(const Eigen::Vector3d& point) const {
  const Groups groups = BlendGroups(point, all_);
  std::array<double, kNumGroups> distances{};
  for (std::size_t g = 0; g < groups.size(); ++g) distances[g] = groups[g].value;
  return distances;
}

bool ImplicitFoot::OnNail(const Eigen::Vector3d& point) const {
  for (const Nail& nail : table_.nails) {
    const NailProfile profile = ProfileOf(nail, 1e3 * (nail.axes.transpose() * (point - nail.centre)));
    if (profile.slab > 0 && profile.outline_mm < 0) return true;
  }
  return false;
}

}  // namespace sole::sim
