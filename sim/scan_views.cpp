#include "sim/scan_views.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "sim/light_path.h"
#include "sim/tracer_internal.h"

namespace sole::sim {
namespace {

using Eigen::Vector3d;

constexpr double kClearance_m = 1e-4;  // steps over the surface itself
constexpr float kUnseen = std::numeric_limits<float>::infinity();

struct Body {
  const TriangleMesh& mesh;
  std::vector<Vector3d> normals;
  std::span<const std::uint8_t> dark;
  SceneTracer tracer;
};

bool LightArrives(const Body& body, const TruePlate& plate, const Vector3d& from,
                  std::size_t vertex, double min_cosine, LightPath* path) {
  const Vector3d& point = body.mesh.vertices[vertex];
  *path = PathBetween(plate, from, point);
  return path->clear && -path->arriving.dot(body.normals[vertex]) > min_cosine &&
         !body.tracer.Blocked({point, -path->arriving}, kClearance_m, path->length_m);
}

/// Incidence at every vertex; kUnseen where the camera does not see it.
std::vector<float> IncidenceAt(const Body& body, const TruePlate& plate, const TrueCamera& camera) {
  const Vector3d centre = camera.Centre();
  const double min_cosine = std::cos(kMaxScanIncidence_rad);
  std::vector<float> incidence(body.mesh.vertices.size(), kUnseen);
  tbb::parallel_for(std::size_t{0}, incidence.size(), [&](std::size_t v) {
    if (!body.dark.empty() && body.dark[v] != 0) return;
    LightPath path;
    if (!LightArrives(body, plate, centre, v, min_cosine, &path)) return;
    const std::optional<Eigen::Vector2d> pixel = PixelOfDirection(camera, path.leaving);
    if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() > camera.width - 1 ||
        pixel->y() > camera.height - 1) {
      return;
    }
    incidence[v] =
        static_cast<float>(std::acos(std::clamp(-path.arriving.dot(body.normals[v]), -1.0, 1.0)));
  });
  return incidence;
}

std::vector<std::uint8_t> LitVertices(const Body& body, const TruePlate& plate,
                                      const std::vector<ProjectorConfig>& projectors) {
  std::vector<std::uint8_t> lit(body.mesh.vertices.size());
  tbb::parallel_for(std::size_t{0}, lit.size(), [&](std::size_t v) {
    LightPath path;
    lit[v] = std::any_of(projectors.begin(), projectors.end(), [&](const ProjectorConfig& lamp) {
      return LightArrives(body, plate, lamp.position_m, v, 0, &path);
    });
  });
  return lit;
}

const TrueCamera& CameraOf(const TrueRig& rig, const std::string& serial) {
  for (const TrueCamera& camera : rig.cameras) {
    if (camera.serial == serial) return camera;
  }
  throw Error("scan views: the true rig has no camera '" + serial + "'");
}

/// Distances along the edges of the mesh from the vertices where they are 0, up to kMaxEdge_m.
void SpreadDistances(const TriangleMesh& mesh, std::vector<float>& distance) {
  constexpr int kRounds =
      8;  // Edges are longer than 0.75 mm; each round goes one further at least.
  const auto relax = [&](int from, int to) {
    const auto a = static_cast<std::size_t>(from), b = static_cast<std::size_t>(to);
    if (distance[a] >= distance[b]) return false;
    const auto length = static_cast<float>((mesh.vertices[a] - mesh.vertices[b]).norm());
    if (distance[a] + length >= distance[b]) return false;
    distance[b] = distance[a] + length;
    return true;
  };
  bool changed = true;
  for (int round = 0; round < kRounds && changed; ++round) {
    changed = false;
    for (const Eigen::Vector3i& t : mesh.triangles) {
      for (int k = 0; k < 3; ++k) {
        const int a = t[k], b = t[(k + 1) % 3];
        changed |= relax(a, b) || relax(b, a);
      }
    }
  }
}

void AddPair(const TriangleMesh& mesh, int pair, bool below, const std::vector<float>& left,
             const std::vector<float>& right, const std::vector<std::uint8_t>& lit,
             std::vector<ScanView>& views) {
  const std::size_t n = views.size();
  std::vector<float> worse(n), edge(n);
  for (std::size_t v = 0; v < n; ++v) {
    worse[v] = lit[v] ? std::max(left[v], right[v]) : kUnseen;
    edge[v] = worse[v] == kUnseen ? 0.0f : kMaxEdge_m;
  }
  SpreadDistances(mesh, edge);
  for (std::size_t v = 0; v < n; ++v) {
    if (worse[v] == kUnseen) continue;
    ScanView& view = views[v];
    if (view.pairs == 0 || worse[v] < view.incidence_rad) {
      view.pair = static_cast<std::int16_t>(pair);
      view.through_glass = below;
      view.incidence_rad = worse[v];
    }
    view.edge_m = std::max(view.edge_m, edge[v]);
    ++view.pairs;
  }
}

}  // namespace

std::vector<ScanView> FindScanViews(const RigConfig& config, const TrueRig& rig,
                                    const TriangleMesh& mesh, std::span<const std::uint8_t> dark) {
  Require(dark.empty() || dark.size() == mesh.vertices.size(),
          "scan views: one dark flag per vertex");
  Scene scene;
  scene.meshes.emplace_back().mesh = mesh;
  const Body body{mesh, VertexNormals(mesh), dark, {scene, config.target.edge_m}};
  const std::vector<std::uint8_t> lit = LitVertices(body, rig.plate, config.simulation.projectors);
  std::vector<ScanView> views(mesh.vertices.size());
  int number = 0;
  for (const PairConfig& pair : config.pairs) {
    const TrueCamera &left = CameraOf(rig, pair.left), &right = CameraOf(rig, pair.right);
    AddPair(mesh, number++, left.Centre().z() < 0, IncidenceAt(body, rig.plate, left),
            IncidenceAt(body, rig.plate, right), lit, views);
  }
  return views;
}

}  // namespace sole::sim
