#pragma once

#include <cstdint>
#include <vector>

#include "core/fit_sequence.h"
#include "core/mesh.h"

namespace sole::sim {

/// The mean adult right foot, unloaded, in the foot frame (metres; x lateral, y towards the toes, z up,
/// origin under the heel's rearmost point; toes are a little raised). Closed, Euler characteristic 2,
/// ends in a flat cap 0.16 m above the sole. Its connectivity is that of every subject, pose and frame:
/// vertex i is the same material point everywhere. Loaded from the program itself, same bits every time.
const TriangleMesh& ReferenceFoot();

/// Triangles of a right foot (the reference's) or of a left foot: the same triangles with their last two
/// indices swapped, because a left foot is a mirrored right one.
const std::vector<Eigen::Vector3i>& FootTriangles(Side side);

/// A point given on the right foot's triangles, for FootTriangles(side): barycentrics swapped on the left.
SurfacePoint OnSide(const SurfacePoint& point_on_right, Side side);

enum class FootMaterial : std::uint8_t { kSkin, kNail, kCut };

/// Material of each vertex; the rim of the cut counts as cut.
const std::vector<FootMaterial>& FootMaterials();

}  // namespace sole::sim
