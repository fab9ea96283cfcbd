#pragma once

#include <utility>
#include <vector>

#include "core/mesh.h"

namespace sole::model {

/// Undirected edges, each once, lower index first, sorted.
std::vector<std::pair<int, int>> Edges(const TriangleMesh& mesh);

/// True for vertices on an open boundary (an edge with one triangle).
std::vector<bool> BoundaryVertices(const TriangleMesh& mesh);

}  // namespace sole::model
