#include "sim/truth_maps.h"

#include <cmath>
#include <cstring>
#include <limits>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/npz.h"
#include "sim/renderer_internal.h"
#include "sim/visibility.h"

namespace sole::sim {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

/// The first body on a camera's ray, through the glass where it lies between.
SceneHit FirstBody(const TruePlate& plate, const SceneTracer& tracer, const LightRay& ray) {
  LightRay last = ray;
  if (ray.origin.z() < 0 && ray.direction.z() > 0) {
    const PlateCrossing crossing = CrossPlate(plate, ray);
    if (crossing.kind == PlateCrossing::Kind::kEdge) return {};
    constexpr double kBackOff_m = 0.001;
    if (crossing.kind == PlateCrossing::Kind::kThrough) {
      last = {crossing.far_point - kBackOff_m * crossing.direction, crossing.direction};
    }
  }
  return tracer.Nearest(last);
}

template <typename T>
io::NpyArray ArrayOf(const Image<T>& image, const std::string& dtype, std::size_t values) {
  io::NpyArray array{dtype,
                     {static_cast<std::size_t>(image.height),
                      static_cast<std::size_t>(image.width)},
                     std::vector<std::uint8_t>(image.pixels.size() * sizeof(T))};
  if (values > 1) array.shape.push_back(values);
  if (!image.pixels.empty())
    std::memcpy(array.bytes.data(), image.pixels.data(), array.bytes.size());
  return array;
}

}  // namespace

TruthMaps MapTruth(const Renderer& renderer, const PreparedScene& scene, int camera,
                   const std::vector<int>& partners) {
  const TrueRig& rig = renderer.Rig();
  std::vector<int> named = partners;
  named.push_back(camera);
  for (const int index : named) {
    Require(index >= 0 && index < static_cast<int>(rig.cameras.size()),
            "truth maps: the rig has no camera " + std::to_string(index));
  }
  const TrueCamera& view = rig.cameras[static_cast<std::size_t>(camera)];
  const PixelRays rays(view);
  const PreparedScene::State& prepared = scene.Get();
  const std::size_t lamps = prepared.exposure == ExposureKind::kSpeckle ? prepared.stride : 0;
  const double min_cosine = std::cos(VisibilityOptions{}.max_incidence_rad);
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const int w = view.width, h = view.height;
  const Vector3f none = Vector3f::Constant(kNan);
  TruthMaps maps{{w, h, -1},   {w, h, -1},   {w, h, none}, {w, h, none},
                 {w, h, none}, {w, h, kNan}, {w, h},       {w, h}};
  tbb::parallel_for(0, h, [&](int y) {
    for (int x = 0; x < w; ++x) {
      const SceneHit hit = FirstBody(rig.plate, prepared.tracer, rays.At(Eigen::Vector2d(x, y)));
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
      normal.normalize();
      maps.mesh.At(x, y) = hit.mesh;
      maps.triangle.At(x, y) = hit.triangle;
      maps.barycentric.At(x, y) = weights;
      maps.point_m.At(x, y) = point.cast<float>();
      maps.normal.At(x, y) = normal;
      maps.depth_m.At(x, y) = static_cast<float>((view.cam_from_world * point).z());
      for (std::size_t lamp = 0; lamp < lamps; ++lamp) {
        float light = 0;
        for (int i = 0; i < 3; ++i) {
          light += weights[i] * mesh.light[static_cast<std::size_t>(t[i]) * lamps + lamp].weight;
        }
        maps.projectors.At(x, y) = static_cast<std::uint8_t>(maps.projectors.At(x, y) + (light > 0));
      }
      for (const int partner : partners) {
        const bool seen = Sees(rig.cameras[static_cast<std::size_t>(partner)], rig.plate,
                               prepared.tracer, point, normal.cast<double>(), min_cosine);
        maps.partners.At(x, y) = static_cast<std::uint8_t>(maps.partners.At(x, y) + seen);
      }
    }
  });
  return maps;
}

std::vector<int> PartnersOf(const RigConfig& config, int camera) {
  const std::string& serial = config.cameras.at(static_cast<std::size_t>(camera)).serial;
  std::vector<int> partners;
  for (const PairConfig& pair : config.pairs) {
    if (pair.left == serial) partners.push_back(CameraIndex(config, pair.right));
    if (pair.right == serial) partners.push_back(CameraIndex(config, pair.left));
  }
  return partners;
}

void WriteTruthMaps(const std::filesystem::path& path, const TruthMaps& maps) {
  static_assert(sizeof(Vector3f) == 3 * sizeof(float));
  io::Npz npz;
  npz["format"] = io::NpyFrom(std::string("sole-truth-maps"));
  npz["version"] = io::Reshaped(io::NpyFrom(std::vector<int>{1}), {});
  npz["units"] = io::NpyFrom(std::string("metres, world frame; row, column"));
  npz["mesh"] = ArrayOf(maps.mesh, "<i4", 1);
  npz["triangle"] = ArrayOf(maps.triangle, "<i4", 1);
  npz["barycentric"] = ArrayOf(maps.barycentric, "<f4", 3);
  npz["point_m"] = ArrayOf(maps.point_m, "<f4", 3);
  npz["normal"] = ArrayOf(maps.normal, "<f4", 3);
  npz["depth_m"] = ArrayOf(maps.depth_m, "<f4", 1);
  npz["projectors"] = ArrayOf(maps.projectors, "|u1", 1);
  npz["partners"] = ArrayOf(maps.partners, "|u1", 1);
  io::MakeDirectory(path.parent_path());
  io::WriteNpz(path, npz);
}

}  // namespace sole::sim
