#pragma once

#include <vector>

#include "core/mesh.h"

namespace sole::model {

/// Part of a mesh below a height, with the place of each of its vertices on the source mesh.
struct ClippedMesh {
  TriangleMesh mesh;
  std::vector<SurfacePoint> source;  ///< per vertex
};

/// Cuts at z = height_m exactly (new vertices lie on edges of the source) and keeps the largest
/// connected part below. Source vertices within 1e-4 edge lengths of the plane are moved into it
/// along an edge. Throws Error where nothing is left.
ClippedMesh ClipBelow(const TriangleMesh& mesh, double height_m);

}  // namespace sole::model
