#include "sim/faults.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

namespace sole::sim {
namespace {

constexpr double kScatter = 0.03;  // of the image width: reach of the fog's halo
constexpr double kVeil = 0.5;      // of the scattered light reaches every pixel alike

/// FNV-1a: the same on every machine.
std::uint64_t SeedOf(const std::string& serial) {
  std::uint64_t hash = 1469598103934665603ULL;
  for (const char c : serial) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  return hash;
}

void Bump(const FaultConfig& fault, TrueCamera& camera) {
  std::mt19937_64 engine(SeedOf(camera.serial));
  const double angle = std::uniform_real_distribution<double>(0, 2 * std::numbers::pi)(engine);
  const Eigen::Vector3d across(std::cos(angle), std::sin(angle), 0);  // in the camera's frame
  if (fault.unit == "deg") {
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(fault.amount * std::numbers::pi / 180, across));
    camera.cam_from_world = Rigid3{turn, Eigen::Vector3d::Zero()} * camera.cam_from_world;
  } else {
    camera.cam_from_world.translation += 1e-3 * fault.amount * across;
  }
}

/// Mean over (2 reach + 1) values along lines, edges repeated.
void BoxBlur(std::vector<float>& values, std::size_t lines, std::size_t length,
             std::size_t line_step, std::size_t step, int reach) {
  const auto n = static_cast<int>(length);
  std::vector<float> in(length);
  for (std::size_t line = 0; line < lines; ++line) {
    float* const at = values.data() + line * line_step;
    for (std::size_t i = 0; i < length; ++i) in[i] = at[i * step];
    const auto value = [&](int i) { return in[static_cast<std::size_t>(std::clamp(i, 0, n - 1))]; };
    double sum = 0;
    for (int i = -reach; i <= reach; ++i) sum += static_cast<double>(value(i));
    for (int i = 0; i < n; ++i) {
      at[static_cast<std::size_t>(i) * step] = static_cast<float>(sum / (2 * reach + 1));
      sum += static_cast<double>(value(i + reach + 1)) - static_cast<double>(value(i - reach));
    }
  }
}

}  // namespace

bool ShowsInImages(const FaultConfig& fault) {
  constexpr std::array kNames = {"bumped-camera", "fog", "hot-pixels", "projector-off",
                                 "lights-on"};
  return std::find(kNames.begin(), kNames.end(), fault.name) != kNames.end();
}

std::vector<FaultConfig> ImageFaultsAt(const std::vector<FaultConfig>& faults,
                                       std::int64_t trigger) {
  std::vector<FaultConfig> active;
  for (const FaultConfig& fault : faults) {
    if (ShowsInImages(fault) && fault.trigger <= trigger) active.push_back(fault);
  }
  return active;
}

TrueRig ApplyFaults(const TrueRig& rig, const std::vector<FaultConfig>& faults) {
  TrueRig changed = rig;
  for (const FaultConfig& fault : faults) {
    for (TrueCamera& camera : changed.cameras) {
      if (!fault.camera.empty() && fault.camera != camera.serial) continue;
      if (fault.name == "bumped-camera") Bump(fault, camera);
      if (fault.name == "fog") camera.fog = fault.amount;
      if (fault.name == "hot-pixels") camera.hot_pixels = fault.amount;
    }
  }
  return changed;
}

RenderOptions ApplyFaults(RenderOptions options, const std::vector<FaultConfig>& faults) {
  for (const FaultConfig& fault : faults) {
    if (fault.name == "projector-off")
      options.dark_projectors.push_back(static_cast<int>(fault.amount) - 1);
    if (fault.name == "lights-on") options.ambient_light += fault.amount;
  }
  return options;
}

ImageF Fogged(const ImageF& radiance, double fog) {
  ImageF halo = radiance;
  const auto width = static_cast<std::size_t>(radiance.width),
             height = static_cast<std::size_t>(radiance.height);
  const int reach = std::max(1, static_cast<int>(kScatter * radiance.width));
  for (int pass = 0; pass < 3; ++pass) {  // Three boxes come close to a Gaussian.
    BoxBlur(halo.pixels, height, width, width, 1, reach);
    BoxBlur(halo.pixels, width, height, 1, width, reach);
  }
  double mean = 0;
  for (const float value : radiance.pixels) mean += static_cast<double>(value);
  mean /= static_cast<double>(radiance.pixels.size());
  for (std::size_t i = 0; i < halo.pixels.size(); ++i) {
    const double scattered = (1 - kVeil) * static_cast<double>(halo.pixels[i]) + kVeil * mean;
    halo.pixels[i] =
        static_cast<float>((1 - fog) * static_cast<double>(radiance.pixels[i]) + fog * scattered);
  }
  return halo;
}

void AddHotPixels(const std::string& serial, double hot, ImageU8& image) {
  std::mt19937_64 engine(SeedOf(serial) + 1);
  std::uniform_int_distribution<std::size_t> any(0, image.pixels.size() - 1);
  const auto count = std::llround(hot * static_cast<double>(image.pixels.size()));
  for (long long i = 0; i < count; ++i) image.pixels[any(engine)] = 255;
}

}  // namespace sole::sim
