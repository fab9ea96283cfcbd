#include "sim/visibility.h"

#include <cmath>
#include <limits>
#include <string>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "core/error.h"
#include "sim/renderer_internal.h"

namespace sole::sim {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kClearance_m = 1e-4;  // steps over the surface itself

bool Sees(const TrueCamera& camera, const TruePlate& plate, const SceneTracer& tracer,
          const Vector3d& point, const Vector3d& normal, double min_cosine) {
  const LightPath path = PathBetween(plate, camera.Centre(), point);
  if (!path.clear || -path.arriving.dot(normal) < min_cosine) return false;
  const std::optional<Eigen::Vector2d> pixel = PixelOfDirection(camera, path.leaving);
  if (!pixel || pixel->x() < 0 || pixel->y() < 0 || pixel->x() > camera.width - 1 ||
      pixel->y() > camera.height - 1) {
    return false;
  }
  return !tracer.Blocked({point, -path.arriving}, kClearance_m, path.length_m);
}

std::vector<std::uint8_t> SeenBy(const TrueCamera& camera, const TruePlate& plate,
                                 const SceneTracer& tracer, const LitMesh& mesh,
                                 double min_cosine) {
  std::vector<std::uint8_t> seen(mesh.vertices.size());
  tbb::parallel_for(std::size_t{0}, seen.size(), [&](std::size_t i) {
    seen[i] =
        Sees(camera, plate, tracer, mesh.vertices[i], mesh.normals[i].cast<double>(), min_cosine);
  });
  return seen;
}

int IndexOf(const TrueRig& rig, const std::string& serial) {
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    if (rig.cameras[i].serial == serial) return static_cast<int>(i);
  }
  throw Error("visibility: the true rig has no camera '" + serial + "'");
}

/// The first body on a camera's ray, through the glass where it lies between.
SceneHit FirstBody(const TruePlate& plate, const SceneTracer& tracer, const LightRay& ray,
                   LightRay* last) {
  *last = ray;
  if (ray.origin.z() < 0 && ray.direction.z() > 0) {
    const PlateCrossing crossing = CrossPlate(plate, ray);
    if (crossing.kind == PlateCrossing::Kind::kEdge) return {};
    constexpr double kBackOff_m = 0.001;
    if (crossing.kind == PlateCrossing::Kind::kThrough) {
      *last = {crossing.far_point - kBackOff_m * crossing.direction, crossing.direction};
    }
  }
  return tracer.Nearest(*last);
}

}  // namespace

std::vector<std::vector<std::uint8_t>> VisibleToPairs(const Renderer& renderer,
                                                      const PreparedScene& scene, int mesh,
                                                      const std::vector<PairConfig>& pairs,
                                                      const VisibilityOptions& options) {
  const PreparedScene::State& state = scene.Get();
  Require(mesh >= 0 && mesh < static_cast<int>(state.meshes.size()),
          "visibility: the scene has no mesh " + std::to_string(mesh));
  Require(state.exposure == ExposureKind::kSpeckle,
          "visibility: prepare the scene for a speckle exposure");
  const LitMesh& body = state.meshes[static_cast<std::size_t>(mesh)];
  const TrueRig& rig = renderer.Rig();
  const double min_cosine = std::cos(options.max_incidence_rad);
  std::vector<std::vector<std::uint8_t>> seen(rig.cameras.size());
  std::vector<std::vector<std::uint8_t>> visible;
  for (const PairConfig& pair : pairs) {
    const auto left = static_cast<std::size_t>(IndexOf(rig, pair.left));
    const auto right = static_cast<std::size_t>(IndexOf(rig, pair.right));
    for (const std::size_t camera : {left, right}) {
      if (!seen[camera].empty()) continue;
      seen[camera] = SeenBy(rig.cameras[camera], rig.plate, state.tracer, body, min_cosine);
    }
    std::vector<std::uint8_t>& flags = visible.emplace_back(body.vertices.size());
    for (std::size_t i = 0; i < flags.size(); ++i) {
      bool lit = false;
      for (std::size_t lamp = 0; lamp < state.stride; ++lamp) {
        lit = lit || body.light[i * state.stride + lamp].weight > 0;
      }
      flags[i] = lit && seen[left][i] && seen[right][i];
    }
  }
  return visible;
}

TruthMaps Renderer::MapTruth(const PreparedScene& scene, int camera) const {
  Require(camera >= 0 && camera < static_cast<int>(state_->rig.cameras.size()),
          "renderer: the rig has no camera " + std::to_string(camera));
  const TrueCamera& view = state_->rig.cameras[static_cast<std::size_t>(camera)];
  const PreparedScene::State& prepared = scene.Get();
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const int w = view.width, h = view.height;
  TruthMaps maps{{w, h, -1},
                 {w, h, -1},
                 {w, h, Vector3f::Constant(kNan)},
                 {w, h, Vector3f::Constant(kNan)},
                 {w, h, Vector3f::Constant(kNan)},
                 {w, h, kNan}};
  tbb::parallel_for(0, h, [&](int y) {
    for (int x = 0; x < w; ++x) {
      LightRay last;
      const SceneHit hit = FirstBody(state_->rig.plate, prepared.tracer,
                                     RayOfPixel(view, Eigen::Vector2d(x, y)), &last);
      if (hit.kind != SceneHit::Kind::kMesh) continue;
      const LitMesh& mesh = prepared.meshes[static_cast<std::size_t>(hit.mesh)];
      const Eigen::Vector3i& t = mesh.triangles[static_cast<std::size_t>(hit.triangle)];
      const Vector3f weights(1 - hit.b1 - hit.b2, hit.b1, hit.b2);
      Vector3d point = Vector3d::Zero();
      Vector3f normal = Vector3f::Zero();
      for (int i = 0; i < 3; ++i) {
        point += static_cast<double>(weights[i]) * mesh.vertices[static_cast<std::size_t>(t[i])];
        normal += weights[i] * mesh.normals[static_cast<std::size_t>(t[i])];
      }
      maps.mesh.At(x, y) = hit.mesh;
      maps.triangle.At(x, y) = hit.triangle;
      maps.barycentric.At(x, y) = weights;
      maps.point_m.At(x, y) = point.cast<float>();
      maps.normal.At(x, y) = normal.normalized();
      maps.depth_m.At(x, y) = static_cast<float>((view.cam_from_world * point).z());
    }
  });
  return maps;
}

}  // namespace sole::sim
