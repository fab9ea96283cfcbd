#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "core/mesh.h"
#include "core/rigid3.h"
#include "sim/implicit_foot.h"

namespace sole::sim {

/// Which toe's skin each vertex is (1 to 5), or 0 for the rest.
std::vector<std::uint8_t> ToeCharts(const ImplicitFoot& foot, const TriangleMesh& mesh);

/// Neighbours of each vertex along edges, sorted.
std::vector<std::vector<int>> VertexNeighbours(std::size_t vertices, const std::vector<Eigen::Vector3i>& triangles);

/// Share of each bone in a vertex's motion (vertices x bones, rows sum to 1): primitives near the skin pull with their owners' motions,
/// smoothed along the skin so that no share jumps between toes.
Eigen::MatrixXf ComputeBoneShares(const ImplicitFoot& foot, const TriangleMesh& mesh,
                                  const std::vector<std::uint8_t>& charts);

/// Where the bones carry the points: the mean of their rigid motions by share. A first guess only.
std::vector<Eigen::Vector3d> CarriedByBones(const std::vector<Eigen::Vector3d>& points, const Eigen::MatrixXf& shares,
                                            const std::vector<Rigid3>& motions);

}  // namespace sole::sim
