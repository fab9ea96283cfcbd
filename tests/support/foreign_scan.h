#pragma once

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "core/mesh.h"
#include "io/scan_file.h"
#include "model/foot_start.h"
#include "model/mesh_topology.h"
#include "model/surface_query.h"
#include "sim/foot.h"

namespace sole::testing_support {

/// A simulated person's foot as another scanner would give it, and where its true surface lies.
struct ForeignScan {
  Side side = Side::kRight;
  TriangleMesh truth;  ///< metres, true position, above the floor (z = 0)
  Rigid3 scan_from_truth;
  io::ScanFile file;   ///< turned and moved anyhow, millimetres
};

/// `kind`: "rest" hangs in the air, "stand" carries half of the weight, "filled" stands and its whole sole is a flat cap,
/// as programs close it that saw no sole.
inline ForeignScan MakeForeignScan(std::uint64_t seed, const std::string& kind) {
  const sim::Subject subject = sim::DrawSubject(seed);
  ForeignScan scan;
  scan.side = subject.side;
  scan.truth = sim::SubjectRestMesh(subject);
  if (kind != "rest")
    scan.truth.vertices = sim::StandOnPlate(subject, 0.5 * 9.81 * subject.weight_kg).foot.vertices_m;
  TriangleMesh scanned = scan.truth;
  if (kind == "filled") {
    const std::vector<Eigen::Vector3d> normals = VertexNormals(scanned);
    for (std::size_t v = 0; v < normals.size(); ++v) {
      if (scanned.vertices[v].z() < 0.003 || (scanned.vertices[v].z() < 0.025 && normals[v].z() < -0.3))
        scanned.vertices[v].z() = 0;
    }
  }
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal(0, 1);
  scan.scan_from_truth.rotation = Eigen::Quaterniond(normal(random), normal(random), normal(random), normal(random)).normalized();
  scan.scan_from_truth.translation = Eigen::Vector3d(normal(random), normal(random), normal(random));
  for (Eigen::Vector3d& v : scanned.vertices) v = 1000 * (scan.scan_from_truth * v);
  scan.file.mesh = std::move(scanned);
  return scan;
}

/// Mean and worst distance, mm, of the true surface to a fitted one (in the scan's frame, metres), over true vertices at
/// least 5 mm above the floor and below the fitted surface's rim.
struct SurfaceDistance {
  double mean_mm = 0, worst_mm = 0;
};
inline SurfaceDistance DistanceAboveSole(const ForeignScan& scan, const TriangleMesh& fitted) {
  TriangleMesh there = fitted;
  const Rigid3 truth_from_scan = scan.scan_from_truth.Inverse();
  for (Eigen::Vector3d& v : there.vertices) v = truth_from_scan * v;
  const model::SurfaceQuery query(there);
  const model::RimPlane rim = model::RimPlaneOf(there, model::BoundaryVertices(there));
  double floor = 1;
  for (const Eigen::Vector3d& v : scan.truth.vertices) floor = std::min(floor, v.z());
  SurfaceDistance result;
  int count = 0;
  for (const Eigen::Vector3d& v : scan.truth.vertices) {
    if (v.z() < floor + 0.005 || rim.Beyond(v + 0.002 * rim.normal)) continue;
    const auto hit = query.Closest(v, 0.2);
    const double mm = hit ? 1e3 * hit->distance_m : 200;
    result.mean_mm += mm;
    result.worst_mm = std::max(result.worst_mm, mm);
    ++count;
  }
  result.mean_mm /= std::max(count, 1);
  return result;
}

}  // namespace sole::testing_support
