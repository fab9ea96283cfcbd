#pragma once

#include <cmath>

#include "core/mesh.h"

namespace sole::model::testing {

/// Open sphere of 50 mm radius: a pole at the bottom and `rings` rings of 6, 12, 18 ... vertices up
/// to 140 degrees from it. A disc in topology: 1 + 3 rings (rings + 1) vertices, 6 rings of them on
/// its one boundary loop. Normals point outwards.
inline TriangleMesh Bowl(int rings) {
  TriangleMesh mesh;
  mesh.vertices.emplace_back(0, 0, -0.05);
  const auto first = [](int ring) { return ring == 0 ? 0 : 1 + 3 * ring * (ring - 1); };
  const auto size = [](int ring) { return ring == 0 ? 1 : 6 * ring; };
  for (int ring = 1; ring <= rings; ++ring) {
    const double polar = 140.0 / 180 * M_PI * ring / rings;
    for (int i = 0; i < size(ring); ++i) {
      const double turn = 2 * M_PI * i / size(ring);
      mesh.vertices.emplace_back(0.05 * std::sin(polar) * std::cos(turn),
                                 0.05 * std::sin(polar) * std::sin(turn), -0.05 * std::cos(polar));
    }
  }
  for (int ring = 1; ring <= rings; ++ring) {
    // Walk both rings together; the one whose next vertex comes first in angle steps on.
    int inner = 0, outer = 0;
    const int n = size(ring - 1), m = size(ring);
    const auto in = [&](int i) { return first(ring - 1) + i % n; };
    const auto out = [&](int i) { return first(ring) + i % m; };
    while (outer < m || (n > 1 && inner < n)) {
      const bool step_outer =
          n == 1 || inner == n || (outer < m && (outer + 1.0) / m <= (inner + 1.0) / n);
      if (step_outer) {
        mesh.triangles.emplace_back(in(inner), out(outer + 1), out(outer));
        ++outer;
      } else {
        mesh.triangles.emplace_back(in(inner), in(inner + 1), out(outer));
        ++inner;
      }
    }
  }
  return mesh;
}

}  // namespace sole::model::testing
