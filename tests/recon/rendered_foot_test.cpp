#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <unordered_map>

#include "recon/reconstruct.h"
#include "sim/posing.h"
#include "sim/reference_foot.h"
#include "sim/renderer.h"
#include "sim/subject.h"
#include "sim/visibility.h"

namespace sole::recon {
namespace {

using Eigen::Vector3d;

/// What a perfect calibration would say of the simulated rig.
Rig PerfectCalibration(const RigConfig& config, const sim::TrueRig& truth) {
  Rig rig;
  for (const sim::TrueCamera& c : truth.cameras) {
    Camera camera{c.serial, c.width, c.height, Intrinsics::Zero(), c.cam_from_world};
    camera.intrinsics << c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, 0;
    rig.cameras.push_back(camera);
  }
  for (const PairConfig& p : config.pairs) {
    rig.pairs.push_back({p.name, CameraIndex(config, p.left), CameraIndex(config, p.right)});
  }
  rig.plate = {truth.plate.thickness_m, truth.plate.index};
  return rig;
}

/// The mean foot, pressed flat on the plate by 3 mm.
sim::SceneMesh StandingFoot() {
  const sim::Subject subject = sim::MeanSubject();
  sim::SceneMesh foot;
  foot.mesh.vertices = sim::PoseFoot(subject, sim::StandingPose(subject)).vertices_m;
  foot.mesh.triangles = sim::FootTriangles(subject.side);
  double lowest = 1;
  for (const Vector3d& v : foot.mesh.vertices) lowest = std::min(lowest, v.z());
  for (Vector3d& v : foot.mesh.vertices) v.z() = std::max(0.0, v.z() - lowest - 0.003);
  return foot;
}

/// Points in cells of the search radius.
class NearPoints {
 public:
  NearPoints(std::vector<Vector3d> points, double radius_m)
      : points_(std::move(points)), radius_m_(radius_m) {
    for (std::size_t i = 0; i < points_.size(); ++i) cells_[Key(points_[i], 0, 0, 0)].push_back(i);
  }
  /// Index and distance of the nearest point within the radius; -1 if there is none.
  std::pair<int, double> Nearest(const Vector3d& at) const {
    std::pair<int, double> best{-1, radius_m_};
    for (int code = 0; code < 27; ++code) {
      const auto cell = cells_.find(Key(at, code % 3 - 1, code / 3 % 3 - 1, code / 9 - 1));
      if (cell == cells_.end()) continue;
      for (const std::size_t i : cell->second) {
        const double d = (points_[i] - at).norm();
        if (d < best.second) best = {static_cast<int>(i), d};
      }
    }
    return best;
  }

 private:
  std::int64_t Key(const Vector3d& p, int dx, int dy, int dz) const {
    const auto cell = [&](int axis, int d) {
      return static_cast<std::int64_t>(std::floor(p[axis] / radius_m_)) + d + 5000;
    };
    return (cell(0, dx) * 10000 + cell(1, dy)) * 10000 + cell(2, dz);
  }
  std::vector<Vector3d> points_;
  double radius_m_;
  std::unordered_map<std::int64_t, std::vector<std::size_t>> cells_;
};

TEST(RenderedFoot, AccuracyCompletenessAndPlatform) {
  const RigConfig config = MakeDefaultRig(4, 1200, 913);
  const sim::TrueRig truth = sim::DrawTrueRig(config, 11);
  const sim::Renderer renderer(config, truth, {.seed = 11});
  sim::Scene scene;
  scene.meshes.push_back(StandingFoot());
  const sim::PreparedScene prepared = renderer.Prepare(scene);
  FrameSet frame;
  for (int camera = 0; camera < 4; ++camera) {
    frame.images.emplace_back(
        renderer.Render(prepared, camera, 40 + static_cast<std::uint64_t>(camera)));
  }
  const Rig rig = PerfectCalibration(config, truth);
  const FrameReconstruction result = Reconstructor(rig).Reconstruct(frame);

  // Distance to the surface: along the normal of the nearest vertex (vertices are about 1.5 mm
  // apart).
  const std::vector<Vector3d>& vertices = scene.meshes[0].mesh.vertices;
  const std::vector<Vector3d> normals = VertexNormals(scene.meshes[0].mesh);
  const NearPoints near_vertex(vertices, 0.004);
  double squares = 0, through_glass = 0;
  int count = 0, below = 0, outliers = 0;
  std::vector<Vector3d> measured;
  for (std::size_t i = 0; i < result.cloud.Size(); ++i) {
    measured.push_back(result.cloud.points_m[i].cast<double>());
    const auto [vertex, far] = near_vertex.Nearest(measured.back());
    const auto v = static_cast<std::size_t>(std::max(vertex, 0));
    const double d = vertex < 0 ? 1 : (measured.back() - vertices[v]).dot(normals[v]);
    if (std::abs(d) > 0.001) {
      ++outliers;
      continue;
    }
    squares += d * d;
    ++count;
    if (result.cloud.pair[i] != 0) continue;
    through_glass += d;
    ++below;
  }
  ASSERT_GT(count, 15000);
  EXPECT_LT(std::sqrt(squares / count), 0.0001);
  EXPECT_LT(outliers, 0.01 * count);
  EXPECT_LT(std::abs(through_glass / below), 0.00005);

  const auto visible = sim::VisibleToPairs(renderer, prepared, 0, config.pairs);
  const NearPoints near_point(measured, 0.0015);
  int wanted = 0, found = 0;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    if (visible[0][i] == 0 && visible[1][i] == 0) continue;
    ++wanted;
    found += near_point.Nearest(vertices[i]).first >= 0 ? 1 : 0;
  }
  EXPECT_GT(found, 0.9 * wanted);

  // Fiducials, and nothing of the foot, measure the glass top.
  ASSERT_GT(result.platform.Size(), 500U);
  double height = 0;
  for (const Eigen::Vector3f& p : result.platform.points_m) {
    height += static_cast<double>(p.z()) / static_cast<double>(result.platform.Size());
  }
  EXPECT_LT(std::abs(height), 0.00002);
  RecordProperty("rms_um", static_cast<int>(1e6 * std::sqrt(squares / count)));
  RecordProperty("completeness_permille", 1000 * found / wanted);
}

}  // namespace
}  // namespace sole::recon
