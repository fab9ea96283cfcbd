#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "sim/scene.h"

namespace sole::sim {

/// A closed sphere of about 40,000 vertices.
inline SceneMesh MakeSphere(const Eigen::Vector3d& centre, double radius, int rings = 140) {
  SceneMesh body;
  const int sectors = 2 * rings;
  for (int i = 0; i <= rings; ++i) {
    for (int j = 0; j < sectors; ++j) {
      const double a = std::numbers::pi * i / rings, b = 2 * std::numbers::pi * j / sectors;
      const Eigen::Vector3d out(std::sin(a) * std::cos(b), std::sin(a) * std::sin(b), std::cos(a));
      body.mesh.vertices.push_back(centre + radius * out);
      body.normals.push_back(out);
      if (i == rings) continue;
      const int k = i * sectors + j, n = i * sectors + (j + 1) % sectors;
      body.mesh.triangles.emplace_back(k, n + sectors, n);
      body.mesh.triangles.emplace_back(k, k + sectors, n + sectors);
    }
  }
  return body;
}

}  // namespace sole::sim
