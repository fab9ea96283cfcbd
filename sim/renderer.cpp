#include "sim/renderer.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <random>
#include <string>
#include <utility>

#include "core/error.h"
#include "sim/renderer_internal.h"
#include "sim/sensor.h"

namespace sole::sim {
namespace {

using Eigen::Vector3d;

constexpr double kMostJitter = 4;  // standard deviations

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

/// How far each vertex moves from the middle of the exposure to the shutter's closing; none if that
/// does not show anywhere.
std::vector<Vector3d> Shifts(const SceneMesh& body, double shutter_s) {
  constexpr double kStill_m = 4e-5;  // a fifth of a pixel during the exposure
  Require(body.velocity.empty() || body.velocity.size() == body.mesh.vertices.size(),
          "renderer: a mesh needs a velocity for every vertex, or none");
  std::vector<Vector3d> shifts;
  double fastest = 0;
  for (const Vector3d& velocity : body.velocity) {
    shifts.push_back(0.5 * shutter_s * velocity);
    fastest = std::max(fastest, 2 * shifts.back().norm());
  }
  return fastest > kStill_m ? shifts : std::vector<Vector3d>();
}

double LongestExposure(const TrueRig& rig, double jitter_s) {
  double longest = 0;
  for (const TrueCamera& camera : rig.cameras) longest = std::max(longest, camera.exposure_s);
  return longest + 2 * kMostJitter * jitter_s;
}

/// The camera's share of the time that SceneTracer's 0 to 1 spans.
Shutter ShutterOf(const TrueCamera& camera, double shutter_s, double jitter_s, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  const double late =
      jitter_s * std::clamp(std::normal_distribution<double>()(engine), -kMostJitter, kMostJitter);
  const double middle = 0.5 + late / shutter_s, half = 0.5 * camera.exposure_s / shutter_s;
  return {static_cast<float>(middle - half), static_cast<float>(middle + half)};
}

double CpuSeconds() {
  return static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
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
      dust_cells(SortDust(true_rig.plate, dust)),
      shutter_s(LongestExposure(true_rig, render_options.trigger_jitter_s)) {
  for (const CharucoFace& face : target.faces)
    board_from_body.push_back(face.body_from_board.Inverse());
}

Renderer::Renderer(const RigConfig& config, const TrueRig& rig, const RenderOptions& options)
    : state_(std::make_unique<const State>(config, rig, options)),
      backgrounds_(std::make_unique<Backgrounds>()) {
  Require(config.cameras.size() == rig.cameras.size(),
          "renderer: the true rig belongs to another rig file");
  Require(options.noise >= 0 && options.ambient_light >= 0 && options.trigger_jitter_s >= 0,
          "renderer: noise, ambient light and trigger jitter must not be negative");
}

Renderer::~Renderer() = default;

const TrueRig& Renderer::Rig() const {
  return state_->rig;
}

PreparedScene Renderer::Prepare(const Scene& scene) const {
  Require(!scene.sheet || (scene.meshes.empty() && !scene.world_from_target),
          "renderer: the contact sheet lies alone on the plate");
  std::vector<LitMesh> meshes;
  std::vector<std::vector<Vector3d>> shifts;
  for (const SceneMesh& body : scene.meshes) {
    meshes.push_back(CheckedMesh(body));
    shifts.push_back(meshes.back().shifts = Shifts(body, state_->shutter_s));
  }
  const Lighting& lighting = state_->lighting;
  const ExposureKind kind = scene.exposure;
  auto prepared = std::make_unique<PreparedScene::State>(scene, state_->target.edge_m, shifts);
  const SceneTracer& tracer = prepared->tracer;
  prepared->exposure = kind;
  prepared->world_from_target = scene.world_from_target;
  prepared->fiducials = scene.fiducials;
  prepared->dust = scene.dust;
  prepared->sag = scene.sag;
  prepared->stride = lighting.Stride(kind);
  prepared->meshes = std::move(meshes);
  for (LitMesh& mesh : prepared->meshes) LightMesh(lighting, tracer, kind, mesh);
  if (scene.world_from_target) {
    for (int face = 0; face < 6; ++face) {
      prepared->cube.push_back(LightCubeFace(lighting, tracer, kind, *scene.world_from_target,
                                             state_->target.edge_m, face));
    }
  }
  if (scene.sheet) prepared->sheet = LightSheet(lighting, tracer, kind, *scene.sheet);
  prepared->glass = LightGlass(lighting, tracer, kind, state_->rig.plate);
  return PreparedScene(std::move(prepared));
}

ImageU8 Renderer::Render(const PreparedScene& scene, int camera, std::uint64_t seed,
                         RenderTimes* times) const {
  Require(camera >= 0 && camera < static_cast<int>(state_->rig.cameras.size()),
          "renderer: the rig has no camera " + std::to_string(camera));
  const TrueCamera& view = state_->rig.cameras[static_cast<std::size_t>(camera)];
  const PreparedScene::State& prepared = scene.Get();
  // Cameras rendered with one seed must share neither noise nor jitter.
  constexpr std::uint64_t kStep = 0x9e3779b97f4a7c15ULL;
  const std::uint64_t own_seed = seed + kStep * static_cast<std::uint64_t>(camera);
  const bool reuse = state_->options.reuse_background;
  const Backgrounds::Kind kind{prepared.exposure, prepared.fiducials, prepared.dust};
  RenderTimes spent;
  double start = CpuSeconds();
  const auto lap = [&start] {
    const double now = CpuSeconds();
    return now - std::exchange(start, now);
  };
  const SceneView seen =
      ViewScene(*state_, prepared, view, backgrounds_->Empty(*this, kind)->Get().glass);
  spent.content_s = lap();
  ImageF radiance = reuse ? *backgrounds_->Of(*this, kind, camera) : ImageF(view.width, view.height);
  TraceBlocks(*state_, prepared, seen, view,
              ShutterOf(view, state_->shutter_s, state_->options.trigger_jitter_s, own_seed),
              reuse ? kBodies | kChangedMarks : kAllBlocks, radiance);
  spent.tracing_s = lap();
  ImageU8 image = Expose(view, radiance, state_->options.noise, own_seed, seen.depth_m, kBlock);
  spent.sensor_s = lap();
  if (times != nullptr) {
    times->content_s += spent.content_s;
    times->tracing_s += spent.tracing_s;
    times->sensor_s += spent.sensor_s;
  }
  return image;
}

}  // namespace sole::sim
