#include <algorithm>
#include <cmath>

#include "sim/renderer_internal.h"
#include "sim/target_texture.h"

namespace sole::sim {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr float kCeiling = 0.7f;  // radiance of the room, of its light on other surfaces
constexpr float kFloor = 0.3f;
constexpr float kGroundEdge = 0.02f;  // the plate's matt edge
constexpr float kLampRadiance = 12;   // of a projector's lens, looking into it
constexpr double kLampRadius_m = 0.004;
constexpr double kBackOff_m = 0.001;  // a ray behind the glass starts this much inside of it
constexpr double kContact_m = 0.0001;

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
  return (ray.direction.z() > 0 ? kCeiling : kFloor) * r_.lighting.RoomLight() + LampGlare(ray);
}

Sample PathTracer::GlassMark(const Vector3d& point, const Vector3d& direction) const {
  // A plate that went down by w mirrors and refracts as before but meets the ray w further down. Its slope, below 1 mrad, would move
  // the light by t (1 - 1/n) slope, at most 0.005 mm, and is left out.
  const double down = s_.sag.At(point.x(), point.y());
  const Eigen::Vector2d place = point.head<2>() - down / direction.z() * direction.head<2>();
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

Sample PathTracer::ShadeSheet(const Vector3d& point, std::size_t side) const {
  const LitSheet& sheet = *s_.sheet;
  const Eigen::Vector2d place = sheet.OnSheet(point);
  Sample sample;
  if (!sheet.Covers(place)) return sample;
  const LitGrid& grid = sheet.sides[side];
  sample.light = GridLight(r_.lighting, s_.exposure, s_.stride, grid,
                           (place.x() / sheet.sheet.size_x_m + 0.5) * (grid.nodes_x - 1),
                           (place.y() / sheet.sheet.size_y_m + 0.5) * (grid.nodes_y - 1));
  sample.albedo =
      kBlackAlbedo + (kWhiteAlbedo - kBlackAlbedo) * sheet.print.At(place.x(), place.y());
  sample.surface = kSheetSurface;
  return sample;
}

Sample PathTracer::ShadeMesh(const SceneHit& hit, float time) const {
  const auto index = static_cast<std::size_t>(hit.mesh);
  const LitMesh& mesh = s_.meshes[index];
  const std::vector<float>& gloss = view_.gloss[index];
  const Eigen::Vector3i& triangle = mesh.triangles[static_cast<std::size_t>(hit.triangle)];
  const float weights[3] = {1 - hit.b1 - hit.b2, hit.b1, hit.b2};
  const bool moves = !mesh.shifts.empty();
  WeightedPoint points[6];
  int count = 0;
  Sample sample;
  float tone = 0;
  for (int i = 0; i < 3; ++i) {
    const auto v = static_cast<std::size_t>(triangle[i]);
    const float* const lobes = gloss.data() + v * s_.stride;
    points[count++] = {mesh.light.data() + v * s_.stride, lobes,
                       moves ? (1 - time) * weights[i] : weights[i]};
    if (moves)
      points[count++] = {mesh.light_close.data() + v * s_.stride, lobes, time * weights[i]};
    sample.material += weights[i] * mesh.material[v];
    tone += weights[i] * mesh.tone[v];
  }
  const MixedLight light = MixLight(r_.lighting, s_.exposure, true, points, count);
  sample.light = light.diffuse;
  sample.extra = light.gloss;
  sample.albedo = tone * kSkinAlbedo;
  sample.surface = kFirstMeshSurface + hit.mesh;
  return sample;
}

Sample PathTracer::Shade(const LightRay& ray, const SceneHit& hit, float time) const {
  switch (hit.kind) {
    case SceneHit::Kind::kMesh:
      return ShadeMesh(hit, time);
    case SceneHit::Kind::kCube:
      return ShadeCube(hit);
    case SceneHit::Kind::kNone:
      break;
  }
  return Bare(Background(ray));
}

Sample PathTracer::FromBelow(const LightRay& ray, const Start& start, const SceneHit& hit,
                             unsigned content, float time) const {
  const PlateCrossing& crossing = start.crossing;
  if (crossing.kind == PlateCrossing::Kind::kEdge) return Bare(kGroundEdge);
  if (crossing.kind == PlateCrossing::Kind::kMisses) return Shade(ray, hit, time);
  const auto into = static_cast<float>(crossing.near_transmittance);
  const auto through = into * static_cast<float>(crossing.far_transmittance);
  const Vector3d mirrored(ray.direction.x(), ray.direction.y(), -ray.direction.z());
  float ghosts = (1 - into) * LampGlare({crossing.near_point, mirrored});
  if (s_.sheet && content & kBodies) {
    Sample sample = ShadeSheet(crossing.far_point, 0);
    if (sample.surface != 0) {
      sample.light *= through;
      sample.extra = ghosts;
      return sample;
    }
  }
  Sample sample = content & kMarks ? GlassMark(crossing.far_point, ray.direction) : Sample{};
  if (sample.surface != 0) {
    sample.light *= into;
    sample.extra = ghosts;
    return sample;
  }
  if (hit.kind == SceneHit::Kind::kNone || hit.distance_m > kBackOff_m + kContact_m) {
    const Vector3d leaves = 2 * crossing.far_point - crossing.near_point;  // after the way down
    ghosts += into * into * (1 - through / into) *
              LampGlare({{leaves.x(), leaves.y(), -r_.rig.plate.thickness_m}, mirrored});
  }
  sample = Shade(start.probe, hit, time);
  sample.light *= through;
  sample.extra = through * sample.extra + ghosts;
  return sample;
}

Sample PathTracer::FromAbove(const LightRay& ray, const SceneHit& hit, unsigned content,
                             float time) const {
  if (hit.kind != SceneHit::Kind::kNone) return Shade(ray, hit, time);
  if (s_.sheet && content & kBodies && ray.direction.z() < 0) {
    const double down = (s_.sheet->sheet.thickness_m - ray.origin.z()) / ray.direction.z();
    const Sample sample = ShadeSheet(ray.origin + down * ray.direction, 1);
    if (sample.surface != 0) return sample;
  }
  const PlateCrossing crossing = CrossPlate(r_.rig.plate, ray);
  if (crossing.kind == PlateCrossing::Kind::kEdge) return Bare(kGroundEdge);
  if (crossing.kind == PlateCrossing::Kind::kMisses) return Bare(Background(ray));
  Sample sample = content & kMarks ? GlassMark(crossing.near_point, ray.direction) : Sample{};
  if (sample.surface != 0) return sample;
  const auto into = static_cast<float>(crossing.near_transmittance);
  const auto through = into * static_cast<float>(crossing.far_transmittance);
  sample = Bare(through * Background({crossing.far_point, crossing.direction}));
  if (!r_.options.reflections) return sample;
  // Both faces mirror what is above; light that the lower one mirrors leaves the upper one further
  // on.
  const Vector3d leaves = 2 * crossing.far_point - crossing.near_point;
  const Vector3d mirrored(ray.direction.x(), ray.direction.y(), -ray.direction.z());
  const LightRay upper{crossing.near_point, mirrored}, lower{{leaves.x(), leaves.y(), 0}, mirrored};
  const auto seen = [&](const LightRay& from) {
    const bool bodies = content & kBodies;
    return Shade(from, bodies ? s_.tracer.Nearest(from, kContact_m, time) : SceneHit{}, time)
        .Radiance();
  };
  sample.extra += (1 - into) * seen(upper) + into * (into - through) * seen(lower);
  return sample;
}

PathTracer::Start PathTracer::Begin(const LightRay& ray) const {
  Start start{ray.direction.z() > 0 && ray.origin.z() < 0, {}, ray};
  if (!start.below) return start;
  start.crossing = CrossPlate(r_.rig.plate, ray);
  if (start.crossing.kind == PlateCrossing::Kind::kThrough) {
    start.probe = {start.crossing.far_point - kBackOff_m * start.crossing.direction,
                   start.crossing.direction};
  }
  return start;
}

Sample PathTracer::Finish(const LightRay& ray, const Start& start, const SceneHit& hit,
                          unsigned content, float time) const {
  return start.below ? FromBelow(ray, start, hit, content, time)
                     : FromAbove(ray, hit, content, time);
}

Sample PathTracer::Trace(const LightRay& ray, unsigned content, float time) const {
  const Start start = Begin(ray);
  const SceneHit hit =
      content & kBodies ? s_.tracer.Nearest(start.probe, 0, time) : SceneHit{};
  return Finish(ray, start, hit, content, time);
}

std::array<Sample, 4> PathTracer::TraceFour(const std::array<LightRay, 4>& rays,
                                            unsigned content) const {
  std::array<Start, 4> starts;
  std::array<LightRay, 4> probes;
  for (std::size_t i = 0; i < 4; ++i) {
    starts[i] = Begin(rays[i]);
    probes[i] = starts[i].probe;
  }
  std::array<SceneHit, 4> hits;
  if (content & kBodies) hits = s_.tracer.NearestOfFour(probes);
  std::array<Sample, 4> samples;
  for (std::size_t i = 0; i < 4; ++i) samples[i] = Finish(rays[i], starts[i], hits[i], content, 0.5f);
  return samples;
}

}  // namespace sole::sim
