#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include <Eigen/Core>

#include "core/mesh.h"
#include "core/point_cloud.h"
#include "sim/scan_noise.h"
#include "sim/scan_views.h"

namespace sole::sim {

/// A place on a mesh and how it is seen.
struct ScanPoint {
  SurfacePoint at;
  ScanView view;  ///< interpolated; pair and pairs are those of the nearest vertex
};

/// One place per cell of `voxel_m` that the seen surface runs through, as fusion keeps one point:
/// the one nearest to the cell's mean. Only triangles whose corners are all seen. Deterministic for
/// a seed, in the order of the triangles.
std::vector<ScanPoint> SampleSeenSurface(const TriangleMesh& mesh, std::span<const ScanView> views,
                                         double voxel_m, std::uint64_t seed);

/// View at a point of the mesh. Throws nothing; pairs is 0 if a corner of its triangle is unseen.
ScanView ViewAt(const TriangleMesh& mesh, std::span<const ScanView> views, const SurfacePoint& at);

struct ScanCloudOptions {
  std::uint64_t seed = 1;           ///< of this scan's noise
  std::uint64_t sequence_seed = 1;  ///< of what stays for a sequence: the pairs' offsets
  std::size_t max_points = 0;       ///< thins a larger cloud at random; 0: all of it
};

/// The cloud that reconstruction would make of this surface: SampleSeenSurface with gaps, errors
/// along the normal (correlated, systematic, outliers), normals that are a little off and stated
/// sigmas. No intensities. Same arguments, same bits.
PointCloud MakeScanCloud(const TriangleMesh& mesh, std::span<const ScanView> views,
                         const ScanNoise& noise, const ScanCloudOptions& options = {});

}  // namespace sole::sim
