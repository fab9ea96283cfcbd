#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "sim/anatomy_table.h"

namespace sole::sim {

/// The flesh of a table as a field: negative inside, about the signed distance in metres near the skin. Toes never fuse: where
/// two would overlap, each is cut back to the surface midway between them (touching flesh flattens).
/// The cap of the shank is not part of the field.
class ImplicitFoot {
 public:
  struct Sample {
    double value = 0;
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  };
  /// Primitives that can matter around a point, in blending order.
  using Shortlist = std::vector<std::uint16_t>;

  explicit ImplicitFoot(AnatomyTable table);

  const AnatomyTable& Table() const { return table_; }

  /// Field and gradient. `chart` = 0 sees all toes; 1 to 5 sees the body and that toe only (cut back by its
  /// neighbours), which keeps a toe's skin on its toe.
  Sample Evaluate(const Eigen::Vector3d& point, int chart = 0) const;
  /// The same from a shortlist that is still valid at `point`.
  Sample Evaluate(const Eigen::Vector3d& point, int chart, const Shortlist& shortlist) const;
  /// What Evaluate needs within `radius` of `point`, provided that one stays within 4 mm of the skin there.
  void MakeShortlist(const Eigen::Vector3d& point, double radius, Shortlist& shortlist) const;

  /// Signed distance (first order) of one primitive, with gradient.
  Sample PrimitiveDistance(std::size_t primitive, const Eigen::Vector3d& point) const;
  /// Distance to each blending group (body, toe 1 ... 5) before they are joined.
  std::array<double, kNumGroups> GroupDistances(const Eigen::Vector3d& point) const;
  /// True on the plate of a nail.
  bool OnNail(const Eigen::Vector3d& point) const;

 private:
  struct Cone {
    Eigen::Vector3d start, direction;
    double length, radius_start, slope, tangent;
  };
  struct Ellipsoid {
    Eigen::Vector3d centre;
    Eigen::Matrix3d to_local;  ///< rows: unit axes
    Eigen::Vector3d inverse_radii;
  };

  using Groups = std::array<Sample, kNumGroups>;
  Groups BlendGroups(const Eigen::Vector3d& point, const Shortlist& shortlist) const;
  Sample Join(const Groups& groups, int chart) const;
  Sample NailTerm(const Eigen::Vector3d& point, int chart) const;

  AnatomyTable table_;
  std::vector<int> shape_index_;  ///< into cones_ or ellipsoids_
  std::vector<Cone> cones_;
  std::vector<Ellipsoid> ellipsoids_;
  std::vector<double> reach_;  ///< largest blend radius of this or a later primitive of the group
  Shortlist all_;
};

}  // namespace sole::sim
