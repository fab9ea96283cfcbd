#include "sim/visibility.h"

#include <cmath>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "sim/renderer_internal.h"

namespace sole::sim {
namespace {

using Eigen::Vector3d;

constexpr double kClearance_m = 1e-4;  // steps over the surface itself

}  // namespace

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

namespace {

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

}  // namespace sole::sim
