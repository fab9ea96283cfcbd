#pragma once

#include <span>

#include "model/decimation.h"
#include "model/edit_mesh_internal.h"

namespace sole::model {

/// Alternates edge flips (towards larger least angles) with moving each vertex along the source
/// mesh towards the size-weighted centroid of its triangles. `edit` is numbered like `source`;
/// `sizes` is the wanted edge length at each source vertex.
SubsetMesh RelaxSubset(const TriangleMesh& source, EditMesh& edit, std::span<const double> sizes,
                       int rounds);

}  // namespace sole::model
