#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include "sim/reference_foot.h"
#include "sim/sole_columns_internal.h"
#include "sim/subject_shape.h"

namespace sole::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kMaxTilt = 0.2;

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

}  // namespace

double PressureOf(const Column& column, double penetration_m) {
  if (penetration_m <= 0) return 0;
  const double strain = std::min(penetration_m / column.thickness_m, 0.85);
  return column.stiffness_pa * strain / (1 - strain);
}

double LaidHeight(double z) {
  if (z <= -kSoftening_m) return 0;
  if (z >= kSoftening_m) return z;
  return (z + kSoftening_m) * (z + kSoftening_m) / (4 * kSoftening_m);
}

double PenetrationOf(double z) { return std::max(0.0, -z - kSoftening_m); }

Sole::Sole(const Subject& subject, const std::vector<Vector3d>& vertices, const Eigen::Quaterniond& turn, bool with_toes) {
  const Vector3d toes = turn * Vector3d::UnitY();
  if (toes.head<2>().norm() > 0.1) forward = Vector3d(toes.x(), toes.y(), 0).normalized();
  right = {forward.y(), -forward.x(), 0};
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
    heel = std::min(heel, forward.dot(v));
    tip = std::max(tip, forward.dot(v));
  }
  heel_m = heel;
  length = tip - heel;
  pivot = (heel + 0.4 * length) * forward + lowest * Vector3d::UnitZ();
  const ReferenceBinding& binding = Binding();
  const auto& reference = ReferenceFoot().vertices;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    if (area[v] <= 0 || vertices[v].z() > lowest + 0.05) continue;
    if (!with_toes && binding.charts[v] > 0) continue;
    Column column = ColumnAt(reference[v], binding.charts[v], subject.heel_pad_m);
    column.stiffness_pa *= subject.tissue_stiffness;
    points_.push_back({static_cast<int>(v), vertices[v], area[v], column});
  }
}

double Sole::SetSag(const PlateSag& sag, const Rigid3& motion) {
  double change = 0;
  for (Plantar& p : points_) {
    const Vector3d place = motion * p.point;
    const double now = sag.At(place.x(), place.y());
    change = std::max(change, std::abs(now - p.sag_m));
    p.sag_m = now;
  }
  return change;
}

std::vector<PlateLoad> Sole::Loads(const Rigid3& motion) const {
  std::vector<PlateLoad> loads;
  for (const Plantar& p : points_) {
    const Vector3d place = motion * p.point;
    const double force = PressureOf(p.column, PenetrationOf(place.z() + p.sag_m)) * p.area_m2;
    if (force > 0) loads.push_back({place.x(), place.y(), force});
  }
  return loads;
}

Rigid3 Sole::Motion(double lift, const Vector2d& tilt) const {
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(tilt[0], right) * Eigen::AngleAxisd(tilt[1], forward));
  return {turn, pivot - turn * pivot + Vector3d(0, 0, lift)};
}

Balance Sole::Forces(const Rigid3& motion) const {
  Balance balance;
  const Eigen::Matrix3d turn = motion.rotation.toRotationMatrix();
  for (const Plantar& p : points_) {
    const double z = turn.row(2).dot(p.point) + motion.translation.z() + p.sag_m;
    const double force = PressureOf(p.column, PenetrationOf(z)) * p.area_m2;
    if (force <= 0) continue;
    balance.force += force;
    balance.centre += force * (turn.topRows<2>() * p.point + motion.translation.head<2>());
  }
  if (balance.force > 0) balance.centre /= balance.force;
  return balance;
}

double Sole::LiftFor(double load_n, const Vector2d& tilt) const {
  double low = -0.04, high = 0.06;
  for (int i = 0; i < 40; ++i) {
    const double middle = 0.5 * (low + high);
    (Forces(Motion(middle - pivot.z(), tilt)).force > load_n ? low : high) = middle;
  }
  return 0.5 * (low + high) - pivot.z();
}

Solution SolveBalance(const Sole& sole, const ContactOptions& options) {
  std::vector<int> free;
  Vector2d wanted = Vector2d::Zero();
  if (options.pressure_centre_y) {
    free.push_back(0);
    wanted.y() = sole.heel_m + *options.pressure_centre_y * sole.length;
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
    const Vector2d centre(sole.right.head<2>().dot(s.balance.centre), sole.forward.head<2>().dot(s.balance.centre));
    for (const int axis : free) e[axis] = (centre - wanted)[axis == 0 ? 1 : 0];
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

Solution SolveOnBendingPlate(const ContactOptions& options, Sole& sole, PlateSag& sag) {
  constexpr double kAgreed_m = 1e-6;
  Solution solution = SolveBalance(sole, options);
  if (!options.plate) return solution;
  for (int round = 0; round < 8; ++round) {
    sag = BendPlate(*options.plate, sole.Loads(solution.motion));
    if (sole.SetSag(sag, solution.motion) < kAgreed_m) break;
    solution = SolveBalance(sole, options);
  }
  return solution;
}

}  // namespace sole::sim
