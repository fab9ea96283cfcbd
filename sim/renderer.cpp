#include "sim/renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include <tbb/blocked_range2d.h>
#include <tbb/parallel_for.h>

#include "core/error.h"
#include "sim/renderer_internal.h"
#include "sim/sensor.h"

namespace sole::sim {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Cube face number (-x +x -y +y -z +z) of each side that carries a board; -1 for bare sides.
std::vector<int> FacesBySide(const CalibrationBody& target) {
  std::vector<int> by_side(6, -1);
  for (std::size_t i = 0; i < target.faces.size(); ++i) {
    const Vector3d outward = target.faces[i].body_from_board.rotation * -Vector3d::UnitZ();
    int axis = 0;
    outward.cwiseAbs().maxCoeff(&axis);
    by_side[static_cast<std::size_t>(2 * axis + (outward[axis] > 0 ? 1 : 0))] = static_cast<int>(i);
  }
  return by_side;
}

LitMesh CheckedMesh(const SceneMesh& body) {
  const auto count = static_cast<int>(body.mesh.vertices.size());
  for (const Eigen::Vector3i& t : body.mesh.triangles) {
    Require(t.minCoeff() >= 0 && t.maxCoeff() < count,
            "renderer: a triangle names a vertex the mesh lacks");
  }
  Require(body.normals.empty() || body.normals.size() == body.mesh.vertices.size(),
          "renderer: a mesh needs one normal per vertex, or none");
  Require(body.material.empty() || body.material.size() == body.mesh.vertices.size(),
          "renderer: a mesh needs material coordinates for every vertex, or none");
  Require(body.tone.empty() || body.tone.size() == body.mesh.vertices.size(),
          "renderer: a mesh needs a tone for every vertex, or none");
  LitMesh lit;
  lit.triangles = body.mesh.triangles;
  lit.vertices = body.mesh.vertices;
  const std::vector<Vector3d> normals =
      body.normals.empty() ? VertexNormals(body.mesh) : body.normals;
  const std::vector<Vector3d>& material =
      body.material.empty() ? body.mesh.vertices : body.material;
  for (const Vector3d& n : normals) lit.normals.push_back(n.cast<float>());
  for (const Vector3d& m : material) lit.material.push_back(m.cast<float>());
  lit.tone = body.tone;
  lit.tone.resize(lit.vertices.size(), 1.0f);
  return lit;
}

/// Sixteen points of a pixel, each alone in its sixteenth of the width and of the height; the first
/// four likewise in quarters.
struct SamplePoints {
  std::array<Vector2d, 4> few;
  std::array<Vector2d, 16> many;
  SamplePoints() {
    few = {Vector2d(-0.375, -0.125), Vector2d(-0.125, 0.375), Vector2d(0.125, -0.375),
           Vector2d(0.375, 0.125)};
    for (int i = 0; i < 16; ++i)
      many[static_cast<std::size_t>(i)] = {(i + 0.5) / 16 - 0.5,
                                           ((i * 5 + 2) % 16 + 0.5) / 16 - 0.5};
  }
};

/// Mean albedo over a pixel that lies on one printed surface, from where four rays of the pixel met
/// it: within a pixel the image of a plane is affine to 1e-6. Far finer than rays, so that edges
/// stand where they are. Negative if the pixel reaches the surface's edge.
float MeanAlbedo(const Renderer::State& renderer, const std::array<Sample, 4>& samples,
                 const SamplePoints& points) {
  Vector2d centre = Vector2d::Zero();
  Eigen::Matrix2d print_from_pixel = Eigen::Matrix2d::Zero();
  for (std::size_t i = 0; i < 4; ++i) {
    centre += 0.25 * samples[i].print;
    print_from_pixel += samples[i].print * points.few[i].transpose() /
                        0.3125;  // sum of offset * offset' = 0.3125 I
  }
  const int surface = samples[0].surface;
  float low = 2, high = -1;
  for (int i = 0; i < 9;
       ++i) {  // cells are far wider than pixels: nothing hides between these points
    const float albedo = PrintedAlbedo(renderer, surface,
                                       centre + print_from_pixel * Vector2d(i % 3 - 1, i / 3 - 1));
    low = std::min(low, albedo);
    high = std::max(high, albedo);
  }
  if (low < 0 || low == high) return low;
  constexpr int kSide = 12;
  float sum = 0;
  for (int i = 0; i < kSide * kSide; ++i) {
    const Vector2d offset((i % kSide + 0.5) / kSide - 0.5, (i / kSide + 0.5) / kSide - 0.5);
    sum += PrintedAlbedo(renderer, surface, centre + print_from_pixel * offset);
  }
  return sum / (kSide * kSide);
}

/// Mean radiance of a pixel where something can be seen: four rays; then the mean of the print, or
/// sixteen rays where the four differ at a hard edge.
float PixelRadiance(const Renderer::State& renderer, const PathTracer& tracer,
                    const TrueCamera& camera, int x, int y, std::uint8_t content) {
  static const SamplePoints points;
  const bool bodies = (content & kBodies) != 0;
  const Vector2d pixel(x, y);
  std::array<Sample, 4> samples;
  float mean = 0, light = 0, extra = 0, low = std::numeric_limits<float>::infinity(), high = -low;
  bool one_surface = true;
  for (std::size_t i = 0; i < 4; ++i) {
    samples[i] = tracer.Trace(RayOfPixel(camera, pixel + points.few[i]), bodies);
    one_surface = one_surface && samples[i].surface == samples[0].surface;
    light += 0.25f * samples[i].light;
    extra += 0.25f * samples[i].extra;
    const float radiance = samples[i].Radiance();
    mean += 0.25f * radiance;
    low = std::min(low, radiance);
    high = std::max(high, radiance);
  }
  if (one_surface && samples[0].surface >= 0 && samples[0].surface != kDustSurface) return mean;
  if (one_surface && samples[0].surface < 0) {
    const float albedo = MeanAlbedo(renderer, samples, points);
    if (albedo >= 0) return albedo * light + extra;
  }
  if (high - low < 0.02f) return mean;
  float sum = 0;
  for (const Vector2d& offset : points.many)
    sum += tracer.Trace(RayOfPixel(camera, pixel + offset), bodies).Radiance();
  return sum / 16;
}

/// Fills a block of nothing but background: evenly from a few rays if these agree, else with a ray
/// per pixel (lamps, the plate's edge).
void FillBackground(const PathTracer& tracer, const TrueCamera& camera, int x0, int y0, int x1,
                    int y1, ImageF& radiance) {
  float low = std::numeric_limits<float>::infinity(), high = -low;
  for (int i = 0; i < 9; ++i) {
    const Vector2d pixel(x0 - 0.5 + 0.5 * (i % 3) * kBlock, y0 - 0.5 + 0.5 * (i / 3) * kBlock);
    const float value = tracer.Trace(RayOfPixel(camera, pixel), false).Radiance();
    low = std::min(low, value);
    high = std::max(high, value);
  }
  const bool even = high - low < 1e-4f;
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      radiance.At(x, y) = even ? 0.5f * (low + high)
                               : tracer.Trace(RayOfPixel(camera, Vector2d(x, y)), false).Radiance();
    }
  }
}

}  // namespace

PreparedScene::PreparedScene(std::unique_ptr<const State> state) : state_(std::move(state)) {}
PreparedScene::~PreparedScene() = default;
PreparedScene::PreparedScene(PreparedScene&&) noexcept = default;
PreparedScene& PreparedScene::operator=(PreparedScene&&) noexcept = default;

Renderer::State::State(const RigConfig& config, const TrueRig& true_rig,
                       const RenderOptions& render_options)
    : rig(true_rig),
      options(render_options),
      lighting(config, true_rig.plate, render_options),
      target(MakeCalibrationCube(config.target.edge_m, config.target.squares,
                                 config.target.square_m, config.target.marker_m)),
      target_face(FacesBySide(target)),
      fiducials(config.plate.fiducials),
      dust(ScatterDust(true_rig.plate, render_options.seed)),
      dust_cells(SortDust(true_rig.plate, dust)) {
  for (const CharucoFace& face : target.faces)
    board_from_body.push_back(face.body_from_board.Inverse());
}

Renderer::Renderer(const RigConfig& config, const TrueRig& rig, const RenderOptions& options)
    : state_(std::make_unique<const State>(config, rig, options)) {
  Require(config.cameras.size() == rig.cameras.size(),
          "renderer: the true rig belongs to another rig file");
  Require(options.noise >= 0, "renderer: noise must not be negative");
}

Renderer::~Renderer() = default;

const TrueRig& Renderer::Rig() const {
  return state_->rig;
}

PreparedScene Renderer::Prepare(const Scene& scene) const {
  std::vector<LitMesh> meshes;
  for (const SceneMesh& body : scene.meshes) meshes.push_back(CheckedMesh(body));
  auto prepared = std::make_unique<PreparedScene::State>(scene, state_->target.edge_m);
  prepared->exposure = scene.exposure;
  prepared->world_from_target = scene.world_from_target;
  prepared->fiducials = scene.fiducials;
  prepared->dust = scene.dust;
  prepared->stride = state_->lighting.Stride(scene.exposure);
  prepared->meshes = std::move(meshes);
  for (LitMesh& mesh : prepared->meshes)
    LightMesh(state_->lighting, prepared->tracer, scene.exposure, mesh);
  if (scene.world_from_target) {
    for (int face = 0; face < 6; ++face) {
      prepared->cube.push_back(LightCubeFace(state_->lighting, prepared->tracer, scene.exposure,
                                             *scene.world_from_target, state_->target.edge_m,
                                             face));
    }
  }
  prepared->glass =
      LightGlass(state_->lighting, prepared->tracer, scene.exposure, state_->rig.plate);
  return PreparedScene(std::move(prepared));
}

ImageU8 Renderer::Render(const PreparedScene& scene, int camera, std::uint64_t seed) const {
  Require(camera >= 0 && camera < static_cast<int>(state_->rig.cameras.size()),
          "renderer: the rig has no camera " + std::to_string(camera));
  const TrueCamera& view = state_->rig.cameras[static_cast<std::size_t>(camera)];
  const Image<std::uint8_t> content = FindContent(*state_, scene.Get(), view);
  const PathTracer tracer(*state_, scene.Get());
  ImageF radiance(view.width, view.height);
  tbb::parallel_for(tbb::blocked_range2d<int>(0, content.height, 2, 0, content.width, 16),
                    [&](const auto& range) {
                      for (int by = range.rows().begin(); by < range.rows().end(); ++by) {
                        for (int bx = range.cols().begin(); bx < range.cols().end(); ++bx) {
                          const std::uint8_t what = content.At(bx, by);
                          const int x1 = std::min((bx + 1) * kBlock, view.width),
                                    y1 = std::min((by + 1) * kBlock, view.height);
                          if (what == kNothing) {
                            FillBackground(tracer, view, bx * kBlock, by * kBlock, x1, y1,
                                           radiance);
                            continue;
                          }
                          for (int y = by * kBlock; y < y1; ++y) {
                            for (int x = bx * kBlock; x < x1; ++x)
                              radiance.At(x, y) = PixelRadiance(*state_, tracer, view, x, y, what);
                          }
                        }
                      }
                    });
  // Cameras rendered with one seed must not share their noise.
  constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15ULL;
  return Expose(view, radiance, state_->options.noise,
                seed + kStep * static_cast<std::uint64_t>(camera));
}

}  // namespace sole::sim
