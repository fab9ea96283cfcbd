#include <algorithm>
#include <cmath>

#include "sim/renderer_internal.h"
#include "sim/target_texture.h"

namespace sole::sim {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr float kCeiling = 0.014f;
constexpr float kFloor = 0.006f;
constexpr float kRoomAlbedo = 0.4f;  // of walls and ceiling under the room's lamps
constexpr float kGroundEdge = 0.02f;  // the plate's matt edge
constexpr float kLampRadiance = 12;   // of a projector's lens, looking into it
constexpr double kLampRadius_m = 0.004;
constexpr double kBackOff_m = 0.001;  // a ray behind the glass starts this much inside of it
constexpr double kContact_m = 0.0001;
constexpr float kGloss = 0.06f;

Sample Bare(float radiance) {
  Sample sample;
  sample.extra = radiance;
  return sample;
}

}  // namespace

float PrintedAlbedo(const Renderer::State& renderer, int surface, const Eigen::Vector2d& print) {
  if (surface <= FiducialSurface(0)) {
    return AlbedoOnFiducial(
        renderer.fiducials[static_cast<std::size_t>(FiducialSurface(0) - surface)], print.x(),
        print.y());
  }
  const CharucoFace& board =
      renderer.target.faces[static_cast<std::size_t>(BoardSurface(0) - surface)];
  const double half = 0.5 * renderer.target.edge_m;
  if (std::abs(print.x() - 0.5 * board.squares_x * board.square_m) > half ||
      std::abs(print.y() - 0.5 * board.squares_y * board.square_m) > half) {
    return -1;
  }
  return AlbedoOnBoard(board, print.x(), print.y());
}

float PathTracer::LampGlare(const LightRay& ray) const {
  if (s_.exposure != ExposureKind::kSpeckle || !r_.options.reflections) return 0;
  float sum = 0;
  for (const Lamp& lamp : r_.lighting.Projectors()) {
    if (lamp.power == 0) continue;
    const Vector3d to = lamp.position - ray.origin;
    const double along = to.dot(ray.direction);
    if (along < 0) continue;
    const double miss2 = to.squaredNorm() - along * along;
    const double radius2 = kLampRadius_m * kLampRadius_m;
    if (miss2 < radius2) sum += kLampRadiance * static_cast<float>(1 - miss2 / radius2);
  }
  return sum;
}

float PathTracer::Background(const LightRay& ray) const {
  const float room = kRoomAlbedo * r_.lighting.RoomLight();
  return (ray.direction.z() > 0 ? kCeiling : kFloor) + room + LampGlare(ray);
}

Sample PathTracer::GlassMark(const Vector3d& point) const {
  const Eigen::Vector2d place = point.head<2>();
  Sample sample;
  if (s_.fiducials) {
    for (std::size_t i = 0; i < r_.fiducials.size(); ++i) {
      const float albedo = AlbedoOnFiducial(r_.fiducials[i], place.x(), place.y());
      if (albedo < 0) continue;
      sample.surface = FiducialSurface(static_cast<int>(i));
      sample.albedo = albedo;
      sample.print = place;
      break;
    }
  }
  if (s_.dust && sample.surface == 0) {
    for (const int index : r_.dust_cells[DustCell(r_.rig.plate, place.x(), place.y())]) {
      const Dust& speck = r_.dust[static_cast<std::size_t>(index)];
      if ((place - speck.centre_m).squaredNorm() > speck.radius_m * speck.radius_m) continue;
      sample.surface = kDustSurface;
      sample.albedo = 0.45f;
    }
  }
  if (sample.surface == 0) return sample;
  const LitGrid& grid = s_.glass;
  sample.light = GridLight(r_.lighting, s_.exposure, s_.stride, grid,
                           (place.x() - grid.origin.x()) / grid.along_x.x(),
                           (place.y() - grid.origin.y()) / grid.along_y.y());
  return sample;
}

Sample PathTracer::ShadeCube(const SceneHit& hit) const {
  const int axis = hit.face / 2;
  const LitGrid& grid = s_.cube[static_cast<std::size_t>(hit.face)];
  const double half = 0.5 * r_.target.edge_m, cells = grid.nodes_x - 1;
  Sample sample;
  sample.light = GridLight(r_.lighting, s_.exposure, s_.stride, grid,
                           (hit.in_body[(axis + 1) % 3] + half) / (2 * half) * cells,
                           (hit.in_body[(axis + 2) % 3] + half) / (2 * half) * cells);
  const int board = r_.target_face[static_cast<std::size_t>(hit.face)];
  sample.surface = kBareCubeSurface;
  sample.albedo = kBareAlbedo;
  if (board >= 0) {
    const Rigid3& board_from_body = r_.board_from_body[static_cast<std::size_t>(board)];
    sample.print = (board_from_body * hit.in_body).head<2>();
    sample.surface = BoardSurface(board);
    sample.albedo = AlbedoOnBoard(r_.target.faces[static_cast<std::size_t>(board)],
                                  sample.print.x(), sample.print.y());
  }
  return sample;
}

Sample PathTracer::ShadeMesh(const LightRay& ray, const SceneHit& hit) const {
  const LitMesh& mesh = s_.meshes[static_cast<std::size_t>(hit.mesh)];
  const Eigen::Vector3i& triangle = mesh.triangles[static_cast<std::size_t>(hit.triangle)];
  const float weights[3] = {1 - hit.b1 - hit.b2, hit.b1, hit.b2};
  WeightedPoint points[3];
  Vector3f normal = Vector3f::Zero(), material = Vector3f::Zero();
  float tone = 0;
  for (int i = 0; i < 3; ++i) {
    const auto v = static_cast<std::size_t>(triangle[i]);
    points[i] = {mesh.light.data() + v * s_.stride, weights[i]};
    normal += weights[i] * mesh.normals[v];
    material += weights[i] * mesh.material[v];
    tone += weights[i] * mesh.tone[v];
  }
  const float light = MixLight(r_.lighting, s_.exposure, points, 3);
  // A weak lobe around the mirror direction, strongest at grazing view; wetted skin on the glass
  // has none.
  const float cosine =
      std::clamp(-normal.normalized().dot(ray.direction.cast<float>()), 0.0f, 1.0f);
  const float sheen = (1 - cosine) * (1 - cosine);
  Sample sample;
  sample.light = light;
  sample.albedo = tone * SkinAlbedo(material) + kGloss * sheen;
  sample.surface = kFirstMeshSurface + hit.mesh;
  return sample;
}

Sample PathTracer::Shade(const LightRay& ray, const SceneHit& hit) const {
  switch (hit.kind) {
    case SceneHit::Kind::kMesh:
      return ShadeMesh(ray, hit);
    case SceneHit::Kind::kCube:
      return ShadeCube(hit);
    case SceneHit::Kind::kNone:
      break;
  }
  return Bare(Background(ray));
}

Sample PathTracer::FromBelow(const LightRay& ray, bool bodies) const {
  const PlateCrossing crossing = CrossPlate(r_.rig.plate, ray);
  const auto nearest = [&](const LightRay& from, double from_m) {
    return bodies ? s_.tracer.Nearest(from, from_m) : SceneHit{};
  };
  if (crossing.kind == PlateCrossing::Kind::kEdge) return Bare(kGroundEdge);
  if (crossing.kind == PlateCrossing::Kind::kMisses) return Shade(ray, nearest(ray, 0));
  const auto into = static_cast<float>(crossing.near_transmittance);
  const auto through = into * static_cast<float>(crossing.far_transmittance);
  const Vector3d mirrored(ray.direction.x(), ray.direction.y(), -ray.direction.z());
  float ghosts = (1 - into) * LampGlare({crossing.near_point, mirrored});
  Sample sample = GlassMark(crossing.far_point);
  if (sample.surface != 0) {
    sample.light *= into;
    sample.extra = ghosts;
    return sample;
  }
  const LightRay behind{crossing.far_point - kBackOff_m * crossing.direction, crossing.direction};
  const SceneHit hit = nearest(behind, 0);
  if (hit.kind == SceneHit::Kind::kNone || hit.distance_m > kBackOff_m + kContact_m) {
    const Vector3d leaves = 2 * crossing.far_point - crossing.near_point;  // after the way down
    ghosts += into * into * (1 - through / into) *
              LampGlare({{leaves.x(), leaves.y(), -r_.rig.plate.thickness_m}, mirrored});
  }
  sample = Shade(behind, hit);
  sample.light *= through;
  sample.extra = through * sample.extra + ghosts;
  return sample;
}

Sample PathTracer::FromAbove(const LightRay& ray, bool bodies) const {
  const SceneHit hit = bodies ? s_.tracer.Nearest(ray) : SceneHit{};
  if (hit.kind != SceneHit::Kind::kNone) return Shade(ray, hit);
  const PlateCrossing crossing = CrossPlate(r_.rig.plate, ray);
  if (crossing.kind == PlateCrossing::Kind::kEdge) return Bare(kGroundEdge);
  if (crossing.kind == PlateCrossing::Kind::kMisses) return Bare(Background(ray));
  Sample sample = GlassMark(crossing.near_point);
  if (sample.surface != 0) return sample;
  const auto into = static_cast<float>(crossing.near_transmittance);
  const auto through = into * static_cast<float>(crossing.far_transmittance);
  sample = Bare(through * Background({crossing.far_point, crossing.direction}));
  if (r_.options.reflections) {
    const LightRay mirrored{crossing.near_point,
                            {ray.direction.x(), ray.direction.y(), -ray.direction.z()}};
    const SceneHit seen = bodies ? s_.tracer.Nearest(mirrored, kContact_m) : SceneHit{};
    // Both faces mirror; the lower one's image lies 2 t / n deeper and is left to lamps only.
    sample.extra += (1 - into) * Shade(mirrored, seen).Radiance();
    const Vector3d leaves = 2 * crossing.far_point - crossing.near_point;
    sample.extra += into * into * (1 - through / into) *
                    LampGlare({{leaves.x(), leaves.y(), 0}, mirrored.direction});
  }
  return sample;
}

Sample PathTracer::Trace(const LightRay& ray, bool bodies) const {
  return ray.direction.z() > 0 && ray.origin.z() < 0 ? FromBelow(ray, bodies)
                                                     : FromAbove(ray, bodies);
}

}  // namespace sole::sim
