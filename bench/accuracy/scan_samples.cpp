#include "bench/accuracy/scan_samples.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <nlohmann/json.hpp>

#include "app/truth.h"
#include "bench/accuracy/error_covariance.h"
#include "io/atomic_file.h"
#include "io/mesh_file.h"
#include "io/take.h"
#include "model/surface_query.h"
#include "sim/reference_foot.h"
#include "sim/scan_cloud.h"

namespace sole::bench {
namespace {

using Eigen::Vector3d;
using sim::ScanView;

constexpr double kReach_m = 0.01;  // points further off are no part of the foot

void AddFrame(const app::FrameTruth& truth, const PointCloud& scan,
              const std::vector<ScanView>& views, double voxel_m, int take, Samples& all) {
  const model::SurfaceQuery query(truth.mesh);
  const std::vector<Vector3d> normals = VertexNormals(truth.mesh);
  const int frame = all.points.empty() ? 0 : all.points.back().frame + 1;
  for (std::size_t i = 0; i < scan.Size(); ++i) {
    const Vector3d p = scan.points_m[i].cast<double>();
    const auto hit = query.Closest(p, kReach_m);
    if (!hit) continue;
    Sample sample;
    sample.view = sim::ViewAt(truth.mesh, views, hit->point);
    sample.take = take;
    sample.frame = frame;
    if (sample.view.pairs == 0) {
      ++all.unseen;
      continue;
    }
    const Eigen::Vector3i& t = truth.mesh.triangles[static_cast<std::size_t>(hit->point.triangle)];
    Vector3d n = Vector3d::Zero();
    for (int k = 0; k < 3; ++k)
      n += hit->point.barycentric[k] * normals[static_cast<std::size_t>(t[k])];
    n.normalize();
    const Vector3d off = p - PositionOf(truth.mesh, hit->point);
    sample.point_m = p;
    sample.error_m = std::copysign(off.norm(), off.dot(n));
    sample.sigma_m = static_cast<double>(scan.sigma_m[i]);
    sample.normal_off_rad = std::acos(std::clamp(n.dot(scan.normals[i].cast<double>()), -1.0, 1.0));
    all.points.push_back(sample);
  }
  const PointGrid grid(scan.points_m, voxel_m);
  for (const sim::ScanPoint& at : sim::SampleSeenSurface(truth.mesh, views, voxel_m, 1)) {
    const Vector3d p = PositionOf(truth.mesh, at.at);
    all.places.push_back({at.view, frame, p, grid.HasNear(p, 0.9 * voxel_m)});
  }
}

}  // namespace

sim::TrueRig ReadTrueRig(const std::filesystem::path& path) {
  const auto json = nlohmann::json::parse(io::ReadFile(path));
  sim::TrueRig rig;
  const auto& plate = json.at("plate");
  rig.plate = {plate.at("size_x_m"), plate.at("size_y_m"), plate.at("thickness_m"),
               plate.at("index")};
  for (const auto& c : json.at("cameras")) {
    sim::TrueCamera camera;
    camera.serial = c.at("serial");
    camera.width = c.at("width");
    camera.height = c.at("height");
    const auto k = c.at("intrinsics").get<std::vector<double>>();
    camera.fx = k.at(0), camera.fy = k.at(1), camera.cx = k.at(2), camera.cy = k.at(3);
    camera.k1 = k.at(4), camera.k2 = k.at(5), camera.p1 = k.at(6), camera.p2 = k.at(7);
    const auto q = c.at("rotation_wxyz").get<std::vector<double>>();
    const auto t = c.at("translation_m").get<std::vector<double>>();
    camera.cam_from_world.rotation = Eigen::Quaterniond(q.at(0), q.at(1), q.at(2), q.at(3));
    camera.cam_from_world.translation = {t.at(0), t.at(1), t.at(2)};
    rig.cameras.push_back(camera);
  }
  return rig;
}

std::vector<std::uint8_t> CutVertices() {
  std::vector<std::uint8_t> dark;
  for (const sim::FootMaterial material : sim::FootMaterials())
    dark.push_back(material == sim::FootMaterial::kCut);
  return dark;
}

Samples ReadTake(const std::filesystem::path& directory, double voxel_m, int take, Samples all) {
  const io::TakePaths paths{directory};
  const io::TakeReader reader(directory);
  const app::TakeTruth truth = app::ReadTruth(directory);
  const sim::TrueRig rig = ReadTrueRig(paths.TruthRig());
  const std::vector<std::uint8_t> dark = CutVertices();
  for (const app::FrameTruth& frame : truth.frames) {
    if (!std::filesystem::exists(paths.Scan(frame.trigger))) continue;
    AddFrame(frame, io::ReadPlyCloud(paths.Scan(frame.trigger)),
             sim::FindScanViews(reader.Config(), rig, frame.mesh, dark), voxel_m, take, all);
  }
  return all;
}

}  // namespace sole::bench
