#include "sim/true_rig.h"

#include <cmath>
#include <numbers>
#include <random>

#include <nlohmann/json.hpp>

#include "io/atomic_file.h"

namespace sole::sim {
namespace {

class Draws {
 public:
  explicit Draws(std::uint64_t seed) : engine_(seed * 7919 + 104729) {}
  double Within(double half) { return Between(-half, half); }
  double Between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Eigen::Vector3d VectorWithin(double half) {
    const double x = Within(half), y = Within(half), z = Within(half);
    return {x, y, z};
  }
  Eigen::Vector3d NormalVector(double sd) {
    std::normal_distribution<double> normal(0, sd);
    const double x = normal(engine_), y = normal(engine_), z = normal(engine_);
    return {x, y, z};
  }

 private:
  std::mt19937_64 engine_;
};

TrueCamera DrawCamera(const CameraConfig& nominal, Draws& draws) {
  TrueCamera camera;
  camera.serial = nominal.serial;
  camera.width = nominal.width;
  camera.height = nominal.height;
  const double scale = nominal.width / 1624.0;
  camera.fx = nominal.focal_px * (1 + draws.Within(0.01));
  camera.fy = camera.fx * (1 + draws.Within(0.0005));
  camera.cx = 0.5 * (nominal.width - 1) + draws.Within(15 * scale);
  camera.cy = 0.5 * (nominal.height - 1) + draws.Within(15 * scale);
  camera.k1 = draws.Between(-0.10, -0.05);
  camera.k2 = draws.Between(-0.02, 0.05);
  camera.p1 = draws.Within(3e-4);
  camera.p2 = draws.Within(3e-4);
  Rigid3 world_from_cam = NominalCamFromWorld(nominal).Inverse();
  world_from_cam.translation += draws.VectorWithin(0.003);
  const Eigen::Vector3d turn = draws.NormalVector(0.3 * std::numbers::pi / 180 / std::sqrt(3.0));
  world_from_cam.rotation =
      (world_from_cam.rotation * Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()))
          .normalized();
  camera.cam_from_world = world_from_cam.Inverse();
  camera.gain = (nominal.exposure_us / kLampExposure_us) * std::pow(10.0, nominal.gain_db / 20) *
                (1 + draws.Within(0.05));
  camera.analogue_gain = std::pow(10.0, nominal.gain_db / 20);
  camera.exposure_s = 1e-6 * nominal.exposure_us;
  camera.aperture_m = nominal.aperture_m;
  camera.focus_m = (nominal.look_at_m - nominal.position_m).norm();
  camera.vignetting = draws.Between(0.08, 0.18);
  camera.blur_px = draws.Between(0.5, 0.7);
  return camera;
}

}  // namespace

TrueRig DrawTrueRig(const RigConfig& config, std::uint64_t seed) {
  Validate(config);
  Draws draws(seed);
  TrueRig rig;
  rig.plate.size_x_m = config.plate.size_x_m;
  rig.plate.size_y_m = config.plate.size_y_m;
  rig.plate.thickness_m = config.plate.thickness_m + draws.Within(0.0003);
  const double index_error = draws.Within(0.005);
  rig.plate.index = config.plate.index + (config.plate.index > 1.01 ? index_error : 0.0);
  for (const CameraConfig& camera : config.cameras)
    rig.cameras.push_back(DrawCamera(camera, draws));
  return rig;
}

void WriteTruthRig(const std::filesystem::path& path, const TrueRig& rig) {
  nlohmann::ordered_json json;
  json["format"] = "sole-truth-rig";
  json["version"] = 1;
  json["units"] = "metres, pixels; world z = 0 is the glass top, z up";
  json["plate"] = {{"thickness_m", rig.plate.thickness_m},
                   {"index", rig.plate.index},
                   {"size_x_m", rig.plate.size_x_m},
                   {"size_y_m", rig.plate.size_y_m}};
  for (const TrueCamera& c : rig.cameras) {
    const Eigen::Quaterniond& q = c.cam_from_world.rotation;
    const Eigen::Vector3d& t = c.cam_from_world.translation;
    json["cameras"].push_back(
        {{"serial", c.serial},
         {"width", c.width},
         {"height", c.height},
         {"intrinsics", {c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, 0.0}},
         {"rotation_wxyz", {q.w(), q.x(), q.y(), q.z()}},
         {"translation_m", {t.x(), t.y(), t.z()}},
         {"gain", c.gain},
         {"vignetting", c.vignetting},
         {"exposure_s", c.exposure_s},
         {"blur_px", c.blur_px},
         {"aperture_m", c.aperture_m},
         {"focus_m", c.focus_m},
         {"fog", c.fog},
         {"hot_pixels", c.hot_pixels}});
  }
  io::MakeDirectory(path.parent_path());
  io::WriteStringAtomically(path, json.dump(1) + "\n");
}

}  // namespace sole::sim
