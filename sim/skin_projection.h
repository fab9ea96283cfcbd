#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "sim/implicit_foot.h"

namespace sole::sim {

/// How a vertex is held: on the skin, on the rim of the cut or in the cut's plane.
enum class SkinKind : std::uint8_t { kSkin, kRim, kCap };

/// Newton's method along the gradient to the skin (and, by kind, to the cut plane). Returns the last point; converges to
/// better than 1 um from a few millimetres.
Eigen::Vector3d ProjectToSkin(const ImplicitFoot& foot, const Eigen::Vector3d& point, SkinKind kind, int chart);

/// Projects every point in place, in parallel.
void ProjectAllToSkin(const ImplicitFoot& foot, std::span<const SkinKind> kinds, std::span<const std::uint8_t> charts,
                      std::span<Eigen::Vector3d> points);

}  // namespace sole::sim
