// Renders frames of the 20-camera rig with a foot standing on the plate, in speckle and in texture
// light, and says where the time goes. The first frame includes the image of the empty rig, which
// later frames reuse. usage: bench_render [FOLDER for the images]
#include <chrono>
#include <cstdio>
#include <ctime>
#include <string>

#include "core/rig_config.h"
#include "io/image_file.h"
#include "sim/reference_foot.h"
#include "sim/renderer.h"
#include "sim/soft_contact.h"

namespace {

using Clock = std::chrono::steady_clock;
constexpr std::uint64_t kSeed = 41;

/// Wall and CPU seconds since it was made.
class Watch {
 public:
  double Wall() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }
  double Cpu() const { return static_cast<double>(std::clock() - cpu_) / CLOCKS_PER_SEC; }

 private:
  Clock::time_point start_ = Clock::now();
  std::clock_t cpu_ = std::clock();
};

sole::sim::Scene StandingFoot() {
  const sole::sim::Subject subject = sole::sim::DrawSubject(kSeed);
  const sole::sim::LoadedFoot standing =
      sole::sim::StandOnPlate(subject, 0.5 * 9.81 * subject.weight_kg);
  sole::sim::Scene scene;
  sole::sim::SceneMesh& foot = scene.meshes.emplace_back();
  foot.mesh = {standing.foot.vertices_m, sole::sim::FootTriangles(subject.side)};
  foot.material = sole::sim::ReferenceFoot().vertices;
  return scene;
}

void RenderFrame(const sole::sim::Renderer& renderer, const sole::sim::Scene& scene,
                 const std::string& name, bool each, const std::string& folder) {
  const Watch frame;
  const sole::sim::PreparedScene prepared = renderer.Prepare(scene);
  const double prepare_s = frame.Cpu();
  sole::sim::RenderTimes times;
  double pixels = 0;
  const auto cameras = static_cast<int>(renderer.Rig().cameras.size());
  for (int camera = 0; camera < cameras; ++camera) {
    const Watch watch;
    const sole::ImageU8 image = renderer.Render(prepared, camera, kSeed, &times);
    pixels += static_cast<double>(image.pixels.size());
    if (each) {
      std::printf("  %s: %.3f s of CPU\n",
                  renderer.Rig().cameras[static_cast<std::size_t>(camera)].serial.c_str(),
                  watch.Cpu());
    }
    if (!folder.empty())
      sole::io::WriteImage(folder + "/" + name + std::to_string(camera) + ".png", image);
  }
  std::printf(
      "%-14s %6.2f s wall, %5.2f Mpixel/s; CPU s: %5.2f = prepare and light %.2f + content and "
      "gloss %.2f + tracing %.2f + sensor %.2f\n",
      name.c_str(), frame.Wall(), 1e-6 * pixels / frame.Wall(), frame.Cpu(), prepare_s,
      times.content_s, times.tracing_s, times.sensor_s);
}

}  // namespace

int main(int argc, char** argv) {
  const std::string folder = argc > 1 ? argv[1] : "";
  const sole::RigConfig config = sole::MakeDefaultRig(20);
  const Watch watch;
  const sole::sim::Renderer renderer(config, sole::sim::DrawTrueRig(config, kSeed),
                                     {.seed = kSeed});
  std::printf("renderer made in %.2f s of CPU\n", watch.Cpu());
  sole::sim::Scene scene = StandingFoot();
  for (const bool texture : {false, true}) {
    scene.exposure = texture ? sole::ExposureKind::kTexture : sole::ExposureKind::kSpeckle;
    const std::string name = texture ? "texture" : "speckle";
    RenderFrame(renderer, scene, name + "-first", false, "");
    RenderFrame(renderer, scene, name, true, folder);
  }
}
