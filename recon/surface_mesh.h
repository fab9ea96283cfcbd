#pragma once

#include "core/mesh.h"
#include "core/point_cloud.h"

namespace sole::recon {

struct MeshOptions {
  int depth = 8;  ///< of the octree: its cells are 1.1 times the cloud's extent over 2^depth, 1.1 mm
  double samples_per_node = 1.5;  ///< points that a cell must hold; more for noisier clouds
  /// Triangles further than this from every point are left out: they close what no camera saw, such
  /// as the cut through the shin. 0: none is left out and open ends are closed, so the mesh is
  /// watertight.
  double trim_m = 0.003;
  double min_piece = 0.01;  ///< share of the triangles; smaller pieces are left out of a trimmed mesh
};

/// Surface through a cloud with normals by Poisson reconstruction (Kazhdan, Bolitho and Hoppe 2006;
/// PCL's), world frame. No triangles for a cloud of fewer than 100 points. Throws Error if the
/// cloud has no normals. The same cloud gives the same mesh.
TriangleMesh MeshFromCloud(const PointCloud& cloud, const MeshOptions& options = {});

}  // namespace sole::recon
