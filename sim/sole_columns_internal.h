#pragma once

#include <vector>

#include <Eigen/Core>

#include "sim/plate_bending.h"
#include "sim/soft_contact.h"

namespace sole::sim {

inline constexpr double kSoftening_m = 0.0014;  ///< the skin rounds off over twice this depth where it leaves the plate

/// The elastic column above a plantar vertex.
struct Column {
  double thickness_m;
  double stiffness_pa;
};

/// Stiffens with depth and grows without bound as the column is used up.
double PressureOf(const Column& column, double penetration_m);
/// Height over the plate of skin that would stand at `z` if there were no plate: smooth, never negative.
double LaidHeight(double z);
/// Shortening of the column of skin that would stand at `z`.
double PenetrationOf(double z);

struct Plantar {
  int vertex;
  Eigen::Vector3d point;
  double area_m2;  ///< seen from below
  Column column;
  double sag_m = 0;  ///< of the plate below it
};

struct Balance {
  double force = 0;
  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
};

/// The plantar skin as columns that move rigidly over the plate.
class Sole {
 public:
  /// `turn` of the foot frame tells which way the toes point.
  Sole(const Subject& subject, const std::vector<Eigen::Vector3d>& vertices, const Eigen::Quaterniond& turn, bool with_toes);

  const std::vector<Plantar>& Points() const { return points_; }
  /// Takes the plate's shape where `motion` brings the points. Returns the largest change.
  double SetSag(const PlateSag& sag, const Rigid3& motion);
  /// The forces on the plate where `motion` brings the points.
  std::vector<PlateLoad> Loads(const Rigid3& motion) const;
  /// Turned by pitch (toes up positive) and roll about the pivot, then lifted.
  Rigid3 Motion(double lift, const Eigen::Vector2d& tilt) const;
  Balance Forces(const Rigid3& motion) const;
  /// Height at which the columns carry the load.
  double LiftFor(double load_n, const Eigen::Vector2d& tilt) const;

  Eigen::Vector3d forward = Eigen::Vector3d::UnitY(), right = Eigen::Vector3d::UnitX();  ///< horizontal, of the foot
  double heel_m = 0, length = 0;                                                         ///< along forward
  Eigen::Vector3d pivot = Eigen::Vector3d::Zero();

 private:
  std::vector<Plantar> points_;
};

struct Solution {
  Rigid3 motion;
  Balance balance;
  bool balanced = false;
};

/// Newton's method on the tilts that are asked for, the lift solved inside; the plate keeps its shape.
Solution SolveBalance(const Sole& sole, const ContactOptions& options);

/// Foot and bending plate in turn: the glass is a hundred times stiffer than the flesh, so they agree after a few rounds.
Solution SolveOnBendingPlate(const ContactOptions& options, Sole& sole, PlateSag& sag);

}  // namespace sole::sim
