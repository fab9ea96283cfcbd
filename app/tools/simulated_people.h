#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/mesh.h"
#include "sim/foot.h"

namespace sole::tools {

/// Joints of the shipped foot model, parents first, with the simulator's bones that each of them
/// moves.
struct ModelJoint {
  std::string name;
  int parent = -1;
  std::vector<std::string> bones;
};
const std::vector<ModelJoint>& ModelJoints();

/// Positions of points of the reference foot on any mesh of its connectivity, M x 3.
Eigen::MatrixX3d PointsOn(std::span<const Eigen::Vector3d> vertices,
                          std::span<const SurfacePoint> points);

/// Share of each model joint in the motion of each point, M x K, rows sum to 1: the simulator's
/// bone shares, summed.
Eigen::MatrixXd JointShares(std::span<const SurfacePoint> points);

/// Joint centres of a subject at rest, K x 3, from its bones. The root's row is left zero: its
/// centre is a matter of the mesh.
Eigen::MatrixX3d JointCentres(const sim::Subject& subject);

/// A random pose within `share` of every joint's range.
sim::FootPose RandomPose(const sim::Subject& subject, std::uint64_t seed, double share);

/// One person sampled at points of the reference foot.
struct Person {
  Eigen::MatrixX3d rest_m;                   ///< M x 3
  Eigen::MatrixX3d joints_m;                 ///< K x 3
  std::vector<Eigen::MatrixX3d> posed_m;     ///< unloaded, in the asked number of poses
  std::vector<Eigen::MatrixX3d> standing_m;  ///< loaded, one per asked load
};

struct PersonOptions {
  int poses = 0;
  double pose_share = 0.8;
  std::vector<double> loads_n = {};
};

/// Right feet of the given seeds, in their order; deterministic, in parallel.
std::vector<Person> DrawPeople(std::span<const std::uint64_t> seeds,
                               std::span<const SurfacePoint> points, const PersonOptions& options);

}  // namespace sole::tools
