#pragma once

#include <span>
#include <vector>

#include "core/mesh.h"

namespace sole::model {

/// Triangles around each vertex.
std::vector<std::vector<int>> TrianglesOfVertices(std::size_t num_vertices,
                                                  std::span<const Eigen::Vector3i> triangles);

/// Neighbours of each vertex, ascending.
std::vector<std::vector<int>> NeighboursOfVertices(std::size_t num_vertices,
                                                   std::span<const Eigen::Vector3i> triangles);

/// Boundary loops, each in the order of the triangles' edges (surface on the left). Throws Error
/// where a boundary vertex has more than two boundary edges.
std::vector<std::vector<int>> BoundaryLoops(std::span<const Eigen::Vector3i> triangles);

/// True where every edge has one or two triangles, neighbours agree in orientation and the
/// triangles around each vertex form one fan.
bool IsOrientedManifold(std::size_t num_vertices, std::span<const Eigen::Vector3i> triangles);

/// Vertices in use - edges + triangles.
int EulerCharacteristic(std::span<const Eigen::Vector3i> triangles);

/// 4 sqrt(3) area / sum of squared edges: 1 for an equilateral triangle, 0 for a degenerate one.
double TriangleQuality(const Eigen::Vector3d& a, const Eigen::Vector3d& b,
                       const Eigen::Vector3d& c);

/// A third of the area of the triangles around each vertex, m2.
std::vector<double> VertexAreas(const TriangleMesh& mesh);

}  // namespace sole::model
