#pragma once

#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>

#include "core/mesh.h"

namespace sole::model {

/// Closest-point and ray queries on a triangle mesh, through Embree's bounding volumes;
/// distances are evaluated in double precision. Queries may run from several threads.
class SurfaceQuery {
 public:
  /// Throws Error if the mesh has no triangles or indices out of range.
  explicit SurfaceQuery(const TriangleMesh& mesh);
  ~SurfaceQuery();
  SurfaceQuery(SurfaceQuery&&) noexcept;
  SurfaceQuery& operator=(SurfaceQuery&&) noexcept;

  /// Moves the mesh's vertices; cheaper than a new query where they move little against each other.
  /// Throws Error if their number changes. Not while another thread asks.
  void Move(const std::vector<Eigen::Vector3d>& vertices_m);

  struct Hit {
    SurfacePoint point;
    Eigen::Vector3d position;
    double distance_m = 0;
  };
  /// The point of the surface nearest to `query`, if one lies within `radius_m`.
  std::optional<Hit> Closest(const Eigen::Vector3d& query, double radius_m) const;

  /// Where a ray first meets the surface, from either side, within `reach_m` of its origin;
  /// `direction` need not have length 1. Rays that run along a triangle may miss it.
  std::optional<Hit> FirstAlong(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                                double reach_m) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Barycentric coordinates of the point of triangle a b c nearest to `p`.
Eigen::Vector3d ClosestBarycentric(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                   const Eigen::Vector3d& b, const Eigen::Vector3d& c);

}  // namespace sole::model
