#include "sim/soft_contact.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "core/error.h"
#include "sim/reference_foot.h"
#include "sim/subject_shape.h"

namespace sole::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kContactGap = 1e-4;     // labels: contact below this gap
constexpr double kSoftening = 0.0014;    // the skin rounds off over twice this depth where it leaves the plate
constexpr double kMaxTilt = 0.2;

/// The elastic column above a plantar vertex.
struct Column {
  double thickness_m;
  double stiffness_pa;
};

/// Tissue under the bones along the reference foot: heel pad, arch, ball, toe pulps.
Column ColumnAt(const Vector3d& reference, int chart, double heel_pad_m) {
  const auto step = [](double x, double from, double to) {
    const double t = std::clamp((x - from) / (to - from), 0.0, 1.0);
    return t * t * (3 - 2 * t);
  };
  if (chart > 0) return {0.008, 160e3};
  const double arch = step(reference.y(), 0.065, 0.09), ball = step(reference.y(), 0.14, 0.165);
  return {heel_pad_m + (0.014 - heel_pad_m) * arch + (0.0115 - 0.014) * ball,
          850e3 + (110e3 - 850e3) * arch + (290e3 - 110e3) * ball};
}

/// Stiffens with depth and grows without bound as the column is used up.
double PressureOf(const Column& column, double penetration_m) {
  if (penetration_m <= 0) return 0;
  const double strain = std::min(penetration_m / column.thickness_m, 0.85);
  return column.stiffness_pa * strain / (1 - strain);
}

/// Height over the plate of skin that would stand at `z` if there were no plate: smooth, never negative.
double LaidHeight(double z) {
  if (z <= -kSoftening) return 0;
  if (z >= kSoftening) return z;
  return (z + kSoftening) * (z + kSoftening) / (4 * kSoftening);
}

double PenetrationOf(double z) { return std::max(0.0, -z - kSoftening); }

struct Plantar {
  int vertex;
  Vector3d point;
  double area_m2;  ///< seen from below
  Column column;
};

struct Balance {
  double force = 0;
  Vector2d centre = Vector2d::Zero();
};

/// The plantar skin as columns that move rigidly over the plate.
class Sole {
 public:
  Sole(const Subject& subject, const std::vector<Vector3d>& vertices, bool with_toes) {
    const auto& triangles = FootTriangles(subject.side);
    std::vector<double> area(vertices.size(), 0);
    for (const Eigen::Vector3i& t : triangles) {
      const Vector3d& a = vertices[static_cast<std::size_t>(t[0])];
      const Vector3d cross = (vertices[static_cast<std::size_t>(t[1])] - a)
                                 .cross(vertices[static_cast<std::size_t>(t[2])] - a);
      for (const int v : t) area[static_cast<std::size_t>(v)] += std::max(0.0, -cross.z()) / 6;
    }
    double lowest = 1, heel = 1, tip = -1;
    for (const Vector3d& v : vertices) lowest = std::min(lowest, v.z());
    for (const Vector3d& v : vertices) {
      if (v.z() > lowest + 0.06) continue;
      heel = std::min(heel, v.y());
      tip = std::max(tip, v.y());
    }
    heel_y = heel;
    length = tip - heel;
    pivot = {0, heel + 0.4 * length, lowest};
    const ReferenceBinding& binding = Binding();
    const auto& reference = ReferenceFoot().vertices;
    for (std::size_t v = 0; v < vertices.size(); ++v) {
      if (area[v] <= 0 || vertices[v].z() > lowest + 0.05) continue;
      if (!with_toes && binding.charts[v] > 0) continue;
      points_.push_back({static_cast<int>(v), vertices[v], area[v],
                         ColumnAt(reference[v], binding.charts[v], subject.heel_pad_m)});
    }
  }

  const std::vector<Plantar>& Points() const { return points_; }

  /// Turned by pitch (toes up positive) and roll about the pivot, then lifted.
  Rigid3 Motion(double lift, const Vector2d& tilt) const {
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(tilt[0], Vector3d::UnitX()) *
                                  Eigen::AngleAxisd(tilt[1], Vector3d::UnitY()));
    return {turn, pivot - turn * pivot + Vector3d(0, 0, lift)};
  }

  Balance Forces(const Rigid3& motion) const {
    Balance balance;
    const Eigen::Matrix3d turn = motion.rotation.toRotationMatrix();
    for (const Plantar& p : points_) {
      const double z = turn.row(2).dot(p.point) + motion.translation.z();
      const double force = PressureOf(p.column, PenetrationOf(z)) * p.area_m2;
      if (force <= 0) continue;
      balance.force += force;
      balance.centre += force * (turn.topRows<2>() * p.point + motion.translation.head<2>());
    }
    if (balance.force > 0) balance.centre /= balance.force;
    return balance;
  }

  /// Height at which the columns carry the load.
  double LiftFor(double load_n, const Vector2d& tilt) const {
    double low = -0.04, high = 0.06;
    for (int i = 0; i < 40; ++i) {
      const double middle = 0.5 * (low + high);
      (Forces(Motion(middle - pivot.z(), tilt)).force > load_n ? low : high) = middle;
    }
    return 0.5 * (low + high) - pivot.z();
  }

  double heel_y = 0, length = 0;
  Vector3d pivot = Vector3d::Zero();

 private:
  std::vector<Plantar> points_;
};

struct Solution {
  Rigid3 motion;
  Balance balance;
  bool balanced = false;
};

/// Newton's method on the tilts that are asked for, the lift solved inside.
Solution SolveBalance(const Sole& sole, const ContactOptions& options) {
  std::vector<int> free;
  Vector2d wanted = Vector2d::Zero();
  if (options.pressure_centre_y) {
    free.push_back(0);
    wanted.y() = sole.heel_y + *options.pressure_centre_y * sole.length;
  }
  if (options.pressure_centre_x_m) {
    free.push_back(1);
    wanted.x() = *options.pressure_centre_x_m;
  }
  Vector2d tilt = Vector2d::Zero();
  const auto at = [&](const Vector2d& t) {
    Solution s;
    s.motion = sole.Motion(sole.LiftFor(options.load_n, t), t);
    s.balance = sole.Forces(s.motion);
    return s;
  };
  const auto error = [&](const Solution& s) {
    Vector2d e = Vector2d::Zero();
    for (const int axis : free) e[axis] = (s.balance.centre - wanted)[axis == 0 ? 1 : 0];
    return e;
  };
  const double tolerance = 0.002 * sole.length;
  Solution now = at(tilt);
  for (int i = 0; i < 25 && error(now).norm() > tolerance; ++i) {
    constexpr double kStep = 1e-3;
    Eigen::Matrix2d slope = Eigen::Matrix2d::Identity();
    for (const int axis : free) {
      const Vector2d moved = tilt + kStep * Vector2d::Unit(axis);
      slope.col(axis) = (error(at(moved)) - error(now)) / kStep;
    }
    Vector2d step = -slope.fullPivLu().solve(error(now));
    step *= std::min(1.0, 0.03 / std::max(step.norm(), 1e-12));
    Solution next = at((tilt + step).cwiseMax(-kMaxTilt).cwiseMin(kMaxTilt));
    for (int halving = 0; halving < 6 && error(next).norm() > error(now).norm(); ++halving) {
      step *= 0.5;
      next = at((tilt + step).cwiseMax(-kMaxTilt).cwiseMin(kMaxTilt));
    }
    tilt = (tilt + step).cwiseMax(-kMaxTilt).cwiseMin(kMaxTilt);
    now = next;
  }
  now.balanced = std::abs(now.balance.force - options.load_n) < 0.01 * options.load_n &&
                 error(now).norm() < 0.01 * sole.length;
  return now;
}

double VolumeOf(const std::vector<Vector3d>& vertices, const std::vector<Eigen::Vector3i>& triangles) {
  double volume = 0;
  for (const Eigen::Vector3i& t : triangles) {
    volume += vertices[static_cast<std::size_t>(t[0])].dot(
                  vertices[static_cast<std::size_t>(t[1])].cross(vertices[static_cast<std::size_t>(t[2])])) / 6;
  }
  return volume;
}

/// Displaced tissue spreads along the skin (screened diffusion of the shortening) and pushes it sideways; the amount restores
/// most of the volume that the plate took. Toes bulge little, they have room below.
void Bulge(const Subject& subject, const std::vector<double>& shortening, double volume_before,
           std::vector<Vector3d>& vertices) {
  constexpr double kReach2 = 100;      // squared reach in edges, about 15 mm
  constexpr double kRestored = 0.9;
  constexpr double kRound = 0.009;     // skin near the plate sticks to it, so the bulge is fullest above
  const ReferenceBinding& binding = Binding();
  std::vector<double> spread = shortening, next(spread.size());
  for (int pass = 0; pass < 150; ++pass) {
    for (std::size_t v = 0; v < spread.size(); ++v) {
      double sum = 0;
      for (const int n : binding.neighbours[v]) sum += spread[static_cast<std::size_t>(n)];
      next[v] = (shortening[v] + kReach2 * sum / static_cast<double>(binding.neighbours[v].size())) / (1 + kReach2);
    }
    spread.swap(next);
  }
  const auto& triangles = FootTriangles(subject.side);
  const std::vector<Vector3d> normals = VertexNormals({vertices, triangles});
  std::vector<Vector3d> push(vertices.size(), Vector3d::Zero()), trial = vertices;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    if (binding.kinds[v] != SkinKind::kSkin) continue;
    const double toe = static_cast<double>(binding.shares.row(static_cast<Eigen::Index>(v)).tail<14>().sum());
    const double rise = std::clamp(vertices[v].z() / kRound, 0.0, 1.0);
    const double free = 0.08 + 0.92 * rise * rise * (3 - 2 * rise);
    push[v] = (1 - 0.85 * toe) * free * spread[v] * Vector3d(normals[v].x(), normals[v].y(), 0);
    trial[v] += push[v];
  }
  const double laid = VolumeOf(vertices, triangles), gained = VolumeOf(trial, triangles) - laid;
  const double amount = gained > 0 ? std::clamp(kRestored * (volume_before - laid) / gained, 0.0, 8.0) : 0;
  for (std::size_t v = 0; v < vertices.size(); ++v) vertices[v] += amount * push[v];
}

void Place(const Rigid3& motion, PosedFoot& foot) {
  for (Vector3d& v : foot.vertices_m) v = motion * v;
  for (Rigid3& bone : foot.world_from_rest) bone = motion * bone;
}

LoadedFoot Unloaded(PosedFoot foot) {
  LoadedFoot loaded;
  const std::size_t n = foot.vertices_m.size();
  loaded.contact.assign(n, 0);
  loaded.penetration_m.assign(n, 0);
  loaded.pressure_pa.assign(n, 0);
  loaded.load_n.assign(n, 0);
  loaded.foot = std::move(foot);
  return loaded;
}

}  // namespace

LoadedFoot PressOnPlate(const Subject& subject, const FootPose& pose, const ContactOptions& options) {
  LoadedFoot loaded = Unloaded(PoseFoot(subject, pose));
  std::vector<Vector3d>& vertices = loaded.foot.vertices_m;
  if (options.load_n <= 0) {
    double lowest = 0;
    for (const Vector3d& v : vertices) lowest = std::min(lowest, v.z());
    if (lowest < 0) Place({Eigen::Quaterniond::Identity(), Vector3d(0, 0, kContactGap - lowest)}, loaded.foot);
    loaded.balanced = true;
    return loaded;
  }
  const Sole sole(subject, vertices, true);
  const Solution solution = SolveBalance(sole, options);
  Place(solution.motion, loaded.foot);
  loaded.balanced = solution.balanced;
  for (const Plantar& p : sole.Points()) {
    const auto v = static_cast<std::size_t>(p.vertex);
    loaded.penetration_m[v] = PenetrationOf(vertices[v].z());
    loaded.pressure_pa[v] = PressureOf(p.column, loaded.penetration_m[v]);
    loaded.load_n[v] = loaded.pressure_pa[v] * p.area_m2;
    loaded.total_load_n += loaded.load_n[v];
    loaded.pressure_centre_m += loaded.load_n[v] * vertices[v].head<2>();
    if (loaded.load_n[v] > 0) loaded.contact_area_m2 += p.area_m2;
  }
  if (loaded.total_load_n > 0) loaded.pressure_centre_m /= loaded.total_load_n;
  const double volume = VolumeOf(vertices, FootTriangles(subject.side));
  std::vector<double> shortening(vertices.size());
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const double height = LaidHeight(vertices[v].z());
    shortening[v] = height - vertices[v].z();
    vertices[v].z() = height;
    loaded.contact[v] = height < kContactGap ? 1 : 0;
  }
  Bulge(subject, shortening, volume, vertices);
  return loaded;
}

void LowerArch(double share, FootPose& pose) {
  pose.angles_rad["midtarsal.dorsiflexion"] = 0.087 * (1 - std::exp(-2.5 * share));
  pose.angles_rad["subtalar.inversion"] = -0.035 * share;
  for (int ray = 1; ray <= 5; ++ray) {
    pose.angles_rad["tarsometatarsal_" + std::to_string(ray) + ".dorsiflexion"] = 0.015 * share;
  }
}

void ReachForGround(const Subject& subject, const ContactOptions& options, double sink_m, FootPose& pose) {
  const Sole sole(subject, CarryFoot(subject, pose).vertices_m, false);
  const Solution ground = SolveBalance(sole, options);
  LowerToes(subject, (ground.motion * pose.world_from_foot).Inverse(), sink_m, pose);
}

FootPose LoadedStandingPose(const Subject& subject, double load_n, double pressure_centre_y) {
  constexpr double kGravity = 9.81;
  const double share = std::clamp(load_n / (subject.weight_kg * kGravity), 0.0, 1.2);
  FootPose pose;
  pose.world_from_foot = StandingPlacement(subject);
  LowerArch(share, pose);
  // The pulps give way, so they sink only a little.
  ReachForGround(subject, {.load_n = load_n, .pressure_centre_y = pressure_centre_y, .pressure_centre_x_m = {}},
                 0.0016 + 0.0018 * share, pose);
  return pose;
}

LoadedFoot StandOnPlate(const Subject& subject, double load_n, double pressure_centre_y) {
  Require(load_n > 0, "StandOnPlate: the load must be positive; use PressOnPlate with load 0 for the air");
  return PressOnPlate(subject, LoadedStandingPose(subject, load_n, pressure_centre_y),
                      {.load_n = load_n, .pressure_centre_y = pressure_centre_y, .pressure_centre_x_m = {}});
}

}  // namespace sole::sim
