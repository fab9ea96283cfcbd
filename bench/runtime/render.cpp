// Renders a calibration frame and a speckled body, prints megapixels per second and, given a
// folder, writes the images. usage: bench_render [FOLDER]
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <numbers>
#include <string>

#include "core/rig_config.h"
#include "io/image_file.h"
#include "sim/renderer.h"

namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// An ellipsoid with the extent of a foot, flattened where it stands.
sole::sim::SceneMesh MakeBody() {
  constexpr int kRings = 200, kSectors = 200;
  sole::sim::SceneMesh body;
  for (int i = 0; i <= kRings; ++i) {
    for (int j = 0; j < kSectors; ++j) {
      const double a = std::numbers::pi * i / kRings, b = 2 * std::numbers::pi * j / kSectors;
      const Eigen::Vector3d p(0.045 * std::sin(a) * std::cos(b), 0.13 * std::cos(a),
                              0.040 + 0.045 * std::sin(a) * std::sin(b));
      body.mesh.vertices.emplace_back(p.x(), p.y(), std::max(p.z(), 0.0));
      if (i == kRings) continue;
      const int k = i * kSectors + j, n = i * kSectors + (j + 1) % kSectors;
      body.mesh.triangles.emplace_back(k, n, n + kSectors);
      body.mesh.triangles.emplace_back(k, n + kSectors, k + kSectors);
    }
  }
  return body;
}

}  // namespace

int main(int argc, char** argv) {
  const sole::RigConfig config = sole::MakeDefaultRig();
  const sole::sim::Renderer renderer(config, sole::sim::DrawTrueRig(config, 1));
  sole::sim::Scene calibration, speckle, texture;
  calibration.exposure = texture.exposure = sole::ExposureKind::kTexture;
  calibration.world_from_target = sole::sim::CalibrationPoses(1, config.target.edge_m, 1)[0];
  speckle.meshes = texture.meshes = {MakeBody()};
  const std::pair<const char*, const sole::sim::Scene*> scenes[] = {
      {"calibration", &calibration}, {"speckle", &speckle}, {"texture", &texture}};
  for (const auto& [name, scene] : scenes) {
    Clock::time_point start = Clock::now();
    const sole::sim::PreparedScene prepared = renderer.Prepare(*scene);
    std::printf("%s: prepared in %.3f s\n", name, SecondsSince(start));
    for (int camera = 0; camera < static_cast<int>(config.cameras.size()); ++camera) {
      start = Clock::now();
      const std::clock_t cpu_start = std::clock();
      const sole::ImageU8 image =
          renderer.Render(prepared, camera, static_cast<std::uint64_t>(camera));
      const double seconds = SecondsSince(start);
      const double cpu = static_cast<double>(std::clock() - cpu_start) / CLOCKS_PER_SEC;
      std::printf("%s camera %d: %.3f s, %.2f Mpixel/s, %.3f s of CPU\n", name, camera, seconds,
                  image.width * image.height / 1e6 / seconds, cpu);
      if (argc > 1) {
        sole::io::WriteImage(std::string(argv[1]) + "/" + name + std::to_string(camera) + ".png",
                             image);
      }
    }
  }
}
