#pragma once

#include <span>
#include <vector>

#include "core/mesh.h"

namespace sole::model {

struct DecimationOptions {
  int vertices = 4000;             ///< wanted in all
  int boundary_vertices = 60;      ///< wanted on the (one) boundary loop
  double error_weight = 2;         ///< of the distance to the removed surface against edge length
  double min_quality = 0.15;       ///< of any triangle made (1 = equilateral)
  double min_normal_cosine = 0.5;  ///< a collapse turns no triangle further
  double facing_weight = 0;  ///< of triangles that do not face as the source does at their corners
  int improve_rounds = 30;   ///< of edge flips and of moving vertices to better ones of the source
};

/// A mesh whose vertices are vertices of a source mesh.
struct SubsetMesh {
  std::vector<int> vertices;               ///< index in the source, ascending
  std::vector<Eigen::Vector3i> triangles;  ///< indices into `vertices`
};

/// Coarsens an oriented manifold with one boundary loop by half-edge collapses, shortest edges
/// (relative to `size`) and flattest places first; then flips edges and moves vertices along the
/// source so that triangles get regular and edge lengths follow `size`. `size`: wanted relative
/// edge length at each vertex. Throws Error where the numbers cannot be reached.
SubsetMesh Decimate(const TriangleMesh& mesh, std::span<const double> size,
                    const DecimationOptions& options);

/// The subset as a mesh of its own.
TriangleMesh MeshFrom(const TriangleMesh& source, const SubsetMesh& subset);

}  // namespace sole::model
