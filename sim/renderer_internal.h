#pragma once

#include <memory>
#include <mutex>
#include <vector>

#include "core/target.h"
#include "sim/light_path.h"
#include "sim/surfaces_internal.h"

namespace sole::sim {

struct Renderer::State {
  State(const RigConfig& config, const TrueRig& true_rig, const RenderOptions& render_options);

  TrueRig rig;
  RenderOptions options;
  Lighting lighting;
  CalibrationBody target;
  std::vector<int> target_face;  ///< of cube face -x +x -y +y -z +z; -1 for a bare one
  std::vector<Rigid3> board_from_body;
  std::vector<Fiducial> fiducials;
  std::vector<Dust> dust;
  std::vector<std::vector<int>> dust_cells;  ///< specks by cell of the glass top
  double shutter_s;  ///< longest exposure with its jitter: what SceneTracer's time spans
};

/// Radiance of one ray: albedo * light + extra.
struct Sample {
  float light = 0;  ///< that falls on the surface, times what the glass lets through
  float extra = 0;  ///< reflections on top of it, or all of a background's radiance
  float albedo = 0;
  int surface = 0;  ///< 0 background, > 0 bodies, < 0 printed or etched: see PrintedAlbedo
  Eigen::Vector2d print = Eigen::Vector2d::Zero();     ///< place on a printed surface, metres
  Eigen::Vector3f material = Eigen::Vector3f::Zero();  ///< place on a mesh's skin: see SkinTexture

  float Radiance() const { return albedo * light + extra; }
};

inline constexpr int kDustSurface = 1;
inline constexpr int kBareCubeSurface = 2;
inline constexpr int kSheetSurface = 3;
inline constexpr int kFirstMeshSurface = 4;
/// Surface numbers of the boards of the cube, and of fiducials.
inline int BoardSurface(int board) {
  return -1 - board;
}
inline int FiducialSurface(int index) {
  return -100 - index;
}
/// Albedo of a printed surface; negative beyond its edge.
float PrintedAlbedo(const Renderer::State& renderer, int surface, const Eigen::Vector2d& print);

/// Blocks of kBlock x kBlock pixels and what they can show.
inline constexpr int kBlock = 8;
enum BlockContent : std::uint8_t {
  kNothing = 0,
  kMarks = 1,         ///< fiducials or dust
  kBodies = 2,        ///< meshes, cube or sheet, or their mirror images
  kMoving = 4,        ///< of these, some that move visibly while the shutter is open
  kChangedMarks = 8,  ///< marks whose light is not that of the empty rig
};

/// What one camera can see where, and what depends on its place but not on the pixel.
struct SceneView {
  Image<std::uint8_t> blocks;
  ImageF depth_m;  ///< of each block: of the nearest body or mark along the axis; 0 without one
  std::vector<std::vector<float>> gloss;  ///< per mesh: vertices times stride; see WeightedPoint
};
/// `empty_glass` is the light on the glass top without bodies.
SceneView ViewScene(const Renderer::State& renderer, const PreparedScene::State& scene,
                    const TrueCamera& camera, const LitGrid& empty_glass);

/// Follows light from a camera back to its source.
class PathTracer {
 public:
  PathTracer(const Renderer::State& renderer, const PreparedScene::State& scene,
             const SceneView& view)
      : r_(renderer), s_(scene), view_(view) {}
  /// `content`: flags of BlockContent that say what the ray may meet. `time` is that of
  /// SceneTracer. Skin comes without its texture.
  Sample Trace(const LightRay& ray, unsigned content, float time = 0.5f) const;
  /// The same for four rays that lead almost the same way, in the middle of the exposure.
  std::array<Sample, 4> TraceFour(const std::array<LightRay, 4>& rays, unsigned content) const;

 private:
  /// A ray up to where it may meet the first body.
  struct Start {
    bool below;              ///< comes up from under the glass
    PlateCrossing crossing;  ///< of such rays
    LightRay probe;          ///< what is left of the ray for bodies to meet
  };
  Start Begin(const LightRay& ray) const;
  Sample Finish(const LightRay& ray, const Start& start, const SceneHit& hit, unsigned content,
                float time) const;
  Sample FromBelow(const LightRay& ray, const Start& start, const SceneHit& hit, unsigned content,
                   float time) const;
  Sample FromAbove(const LightRay& ray, const SceneHit& hit, unsigned content, float time) const;
  Sample Shade(const LightRay& ray, const SceneHit& hit, float time) const;
  Sample ShadeMesh(const SceneHit& hit, float time) const;
  Sample ShadeCube(const SceneHit& hit) const;
  /// Of surface 0 beside the sheet. Sides: 0 lower, 1 upper.
  Sample ShadeSheet(const Eigen::Vector3d& point, std::size_t side) const;
  /// Marks and dust on the glass top; of surface 0 where it is clear. The ray in air, along
  /// `direction`, meets the unloaded top at `point`.
  Sample GlassMark(const Eigen::Vector3d& point, const Eigen::Vector3d& direction) const;
  /// Room, and lamps that shine into the camera.
  float Background(const LightRay& ray) const;
  float LampGlare(const LightRay& ray) const;

  const Renderer::State& r_;
  const PreparedScene::State& s_;
  const SceneView& view_;
};

/// Whether a camera sees a point of a surface: inside its image, nothing in between, and at an
/// incidence whose cosine is at least `min_cosine`.
bool Sees(const TrueCamera& camera, const TruePlate& plate, const SceneTracer& tracer,
          const Eigen::Vector3d& point, const Eigen::Vector3d& normal, double min_cosine);

/// When a camera's shutter opens and closes, in SceneTracer's time.
struct Shutter {
  float open = 0, close = 1;
};

/// Fills the blocks of `radiance` that have one of the flags of `wanted`, or all of them for
/// kAllBlocks, with what the camera sees.
inline constexpr unsigned kAllBlocks = 0;
void TraceBlocks(const Renderer::State& renderer, const PreparedScene::State& scene,
                 const SceneView& view, const TrueCamera& camera, const Shutter& shutter,
                 unsigned wanted, ImageF& radiance);

/// The rig with nothing in it, as far as it was needed: prepared per kind of exposure and marks,
/// and rendered per camera. Bodies change a small part of it only.
class Backgrounds {
 public:
  struct Kind {
    ExposureKind exposure;
    bool fiducials, dust;
  };
  std::shared_ptr<const PreparedScene> Empty(const Renderer& renderer, const Kind& kind);
  std::shared_ptr<const ImageF> Of(const Renderer& renderer, const Kind& kind, int camera);

 private:
  static std::size_t Index(const Kind& kind);
  std::mutex mutex_;
  std::shared_ptr<const PreparedScene> empty_[8];
  std::vector<std::shared_ptr<const ImageF>> images_[8];
};

}  // namespace sole::sim
