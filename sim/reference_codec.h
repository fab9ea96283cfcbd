#pragma once

#include <string>
#include <string_view>

#include "core/mesh.h"

namespace sole::sim {

/// The reference foot's file: 16-bit coordinates in steps of kReferenceStep from kReferenceLow, vertices as differences,
/// triangles sorted and as differences, bytes in planes, deflated. Positions are rounded by at most half a step.
inline constexpr double kReferenceStep = 5e-6;
inline constexpr double kReferenceLow = -0.08;

std::string EncodeReference(const TriangleMesh& mesh);
/// Throws Error if the bytes are not a reference foot.
TriangleMesh DecodeReference(std::string_view bytes);

}  // namespace sole::sim
