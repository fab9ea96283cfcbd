#include "sim/scan_views.h"

#include <cmath>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>

#include "core/error.h"
#include "sim/visibility.h"
#include "tests/sim/test_bodies.h"

namespace sole::sim {
namespace {

const Eigen::Vector3d kCentre(0, 0, 0.05);
constexpr double kRadius = 0.05;

class ScanViews : public testing::Test {
 protected:
  RigConfig config_ = MakeDefaultRig(8);
  TrueRig rig_ = DrawTrueRig(config_, 2);
  SceneMesh sphere_ = MakeSphere(kCentre, kRadius, 60);
};

TEST_F(ScanViews, CountThePairsThatTheRendererCallsVisible) {
  const Renderer renderer(config_, rig_);
  Scene scene;
  scene.meshes.push_back(sphere_);
  // The mesh's own normals, as FindScanViews takes them.
  scene.meshes[0].normals = VertexNormals(sphere_.mesh);
  const auto visible = VisibleToPairs(renderer, renderer.Prepare(scene), 0, config_.pairs);
  const std::vector<ScanView> views = FindScanViews(config_, rig_, sphere_.mesh);
  ASSERT_EQ(views.size(), sphere_.mesh.vertices.size());
  int seen = 0, several = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    int count = 0;
    for (const auto& of_pair : visible) count += of_pair[v];
    EXPECT_EQ(int{views[v].pairs}, count) << v;
    EXPECT_EQ(views[v].pair >= 0, count > 0);
    if (views[v].pair >= 0) {
      EXPECT_TRUE(visible[static_cast<std::size_t>(views[v].pair)][v]);
    }
    seen += count > 0;
    several += count > 1;
  }
  EXPECT_GT(seen, 3000);
  EXPECT_GT(several, 200);
}

TEST_F(ScanViews, IncidenceIsThatOfTheWorseCameraOfTheBestPair) {
  const std::vector<ScanView> views = FindScanViews(config_, rig_, sphere_.mesh);
  const std::vector<Eigen::Vector3d> normals = VertexNormals(sphere_.mesh);
  int above = 0, below = 0;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const ScanView& view = views[v];
    if (view.pairs == 0) continue;
    double worst = 0;
    const PairConfig& pair = config_.pairs[static_cast<std::size_t>(view.pair)];
    bool glass = false;
    for (const std::string& serial : {pair.left, pair.right}) {
      const TrueCamera& camera =
          rig_.cameras[static_cast<std::size_t>(CameraIndex(config_, serial))];
      glass = glass || camera.Centre().z() < 0;
      const Eigen::Vector3d to_camera = (camera.Centre() - sphere_.mesh.vertices[v]).normalized();
      worst = std::max(worst, std::acos(to_camera.dot(normals[v])));
    }
    EXPECT_EQ(view.through_glass, glass);
    ++(glass ? below : above);
    // Straight through air; through the glass the light is turned by less than two degrees.
    EXPECT_NEAR(view.incidence_rad, worst, glass ? 0.035 : 1e-5) << v;
  }
  EXPECT_GT(above, 1000);
  EXPECT_GT(below, 500);
}

TEST_F(ScanViews, EdgeIsTheDistanceAlongTheSurfaceToWhatThePairDoesNotSee) {
  config_.pairs.resize(1);
  const std::vector<ScanView> views = FindScanViews(config_, rig_, sphere_.mesh);
  const auto& vertices = sphere_.mesh.vertices;
  int inside = 0, near_edge = 0;
  for (std::size_t v = 0; v < views.size(); v += 3) {
    if (views[v].pairs == 0) continue;
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t other = 0; other < views.size(); ++other) {
      if (views[other].pairs == 0)
        nearest = std::min(nearest, (vertices[other] - vertices[v]).norm());
    }
    const auto edge = static_cast<double>(views[v].edge_m);
    EXPECT_GE(edge, std::min<double>(nearest, kMaxEdge_m) - 1e-6);
    EXPECT_LE(edge, std::min<double>(1.5 * nearest, kMaxEdge_m) + 1e-6) << "edges make detours";
    near_edge += edge < 0.005;
    inside += edge >= kMaxEdge_m;
  }
  EXPECT_GT(near_edge, 20);
  EXPECT_GT(inside, 200);
}

TEST_F(ScanViews, DarkVerticesAreNotSeen) {
  std::vector<std::uint8_t> dark(sphere_.mesh.vertices.size());
  for (std::size_t v = 0; v < dark.size(); ++v) dark[v] = sphere_.mesh.vertices[v].z() > 0.09;
  const std::vector<ScanView> all = FindScanViews(config_, rig_, sphere_.mesh),
                              some = FindScanViews(config_, rig_, sphere_.mesh, dark);
  int hidden = 0;
  for (std::size_t v = 0; v < dark.size(); ++v) {
    EXPECT_EQ(int{some[v].pairs}, dark[v] ? 0 : int{all[v].pairs});
    hidden += dark[v] && all[v].pairs > 0;
  }
  EXPECT_GT(hidden, 100);
  dark.pop_back();
  EXPECT_THROW(FindScanViews(config_, rig_, sphere_.mesh, dark), Error);
  rig_.cameras.pop_back();
  EXPECT_THROW(FindScanViews(config_, rig_, sphere_.mesh), Error);
}

}  // namespace
}  // namespace sole::sim
