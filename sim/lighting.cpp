#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

#include <Eigen/Geometry>

#include "core/error.h"
#include "sim/lighting_internal.h"

namespace sole::sim {
namespace {

using Eigen::Vector3d;

constexpr double kPowerAbove = 0.34;   // of a projector, at 1 m
constexpr double kPowerBelow = 0.52;   // fewer of them overlap, and the glass takes its share
constexpr double kPanelPower = 0.095;  // of a panel's half, at 1 m
constexpr double kScatter_m = 0.00017;  // sideways in skin: 0.4 mm wide at half height
constexpr double kScatterFar = 0.12;    // share of the light that goes further than between dots

Eigen::Matrix3d LookAt(const Vector3d& from, const Vector3d& to) {
  const Vector3d z = (to - from).normalized();
  const Vector3d x =
      z.cross(std::abs(z.y()) < 0.9 ? Vector3d::UnitY() : Vector3d::UnitX()).normalized();
  Eigen::Matrix3d rotation;
  rotation.row(0) = x;
  rotation.row(1) = z.cross(x);
  rotation.row(2) = z;
  return rotation;
}

std::vector<Vector3d> PanelPoints() {
  const Vector3d centres[] = {{0.45, 0.45, 0.65},   {-0.45, 0.45, 0.65},  {0.45, -0.45, 0.65},
                              {-0.45, -0.45, 0.65}, {0.75, 0, 0.20},      {-0.75, 0, 0.20},
                              {0, 0.80, 0.20},      {0, -0.80, 0.20},     {0.35, 0.35, -0.70},
                              {-0.35, 0.35, -0.70}, {0.35, -0.35, -0.70}, {-0.35, -0.35, -0.70}};
  std::vector<Vector3d> points;
  for (const Vector3d& centre : centres) {
    const Vector3d along = centre.cross(Vector3d::UnitZ()).normalized();
    points.push_back(centre + 0.08 * along);
    points.push_back(centre - 0.08 * along);
  }
  return points;
}

}  // namespace

Lighting::Lighting(const RigConfig& config, const TruePlate& plate, const RenderOptions& options)
    : plate_(plate),
      room_light_(static_cast<float>(options.ambient_light * kLampExposure_us / kRoomLightExposure_us)),
      panels_(PanelPoints()) {
  double focal_px = std::numeric_limits<double>::infinity();
  for (const CameraConfig& camera : config.cameras) focal_px = std::min(focal_px, camera.focal_px);
  std::uint64_t number = 0;
  for (const ProjectorConfig& projector : config.simulation.projectors) {
    const SpecklePattern slide(options.seed * 1000 + ++number, options.dot_px / focal_px);
    const double distance_m = (projector.look_at_m - projector.position_m).norm();
    projectors_.push_back({projector.position_m, LookAt(projector.position_m, projector.look_at_m),
                           slide, slide.Scattered(kScatter_m / distance_m, kScatterFar),
                           projector.position_m.z() > 0 ? kPowerAbove : kPowerBelow});
  }
  for (const int dark : options.dark_projectors) {
    Require(dark >= 0 && dark < static_cast<int>(projectors_.size()),
            "renderer: the rig has no projector " + std::to_string(dark + 1));
    projectors_[static_cast<std::size_t>(dark)].power = 0;
  }
}

std::size_t Lighting::Stride(ExposureKind kind) const {
  return kind == ExposureKind::kSpeckle ? projectors_.size() : 1;
}

double Lighting::Strength(const SceneTracer& tracer, const Vector3d& lamp, const Place& place,
                          Vector3d* leaving) const {
  const LightPath path = PathBetween(plate_, lamp, place.point);
  *leaving = path.leaving;
  double cosine = -path.arriving.dot(place.normal);
  if (place.two_sided) cosine = 0.6 * std::abs(cosine);  // frosted glass scatters to both sides
  if (cosine <= 0 || !path.clear) return 0;
  // Bodies stand above the glass, so the last, straight piece of the path is the one that may be
  // blocked.
  if (tracer.Blocked({place.point, -path.arriving}, place.clearance_m, path.length_m, place.time))
    return 0;
  return cosine * path.transmittance / (path.length_m * path.length_m);
}

void Lighting::At(const SceneTracer& tracer, ExposureKind kind, const Place& place, LampLight* out,
                  float* panels) const {
  Vector3d leaving;
  if (kind == ExposureKind::kTexture) {
    double sum = 0;
    for (const Vector3d& panel : panels_) {
      const double strength = kPanelPower * Strength(tracer, panel, place, &leaving);
      if (panels != nullptr) *panels++ = static_cast<float>(strength);
      sum += strength;
    }
    *out = {0, 0, static_cast<float>(sum)};
    return;
  }
  for (const Lamp& lamp : projectors_) {
    const double strength = Strength(tracer, lamp.position, place, &leaving);
    const Vector3d slide = lamp.lamp_from_world * leaving;
    *out++ = slide.z() > 0.05 ? LampLight{static_cast<float>(slide.x() / slide.z()),
                                          static_cast<float>(slide.y() / slide.z()),
                                          static_cast<float>(lamp.power * strength)}
                              : LampLight{};
  }
}

float GlossLobe(const Eigen::Vector3f& normal, const Eigen::Vector3f& to_lamp,
                const Eigen::Vector3f& to_viewer) {
  // Blinn's lobe of exponent 16 (skin is rough), normalised, and Schlick's Fresnel factor.
  constexpr float kNormalReflectance = 0.028f, kPeak = (16 + 8) / 8.0f;
  const Eigen::Vector3f half = (to_lamp + to_viewer).normalized();
  float lobe = std::max(normal.dot(half), 0.0f);
  for (int i = 0; i < 4; ++i) lobe *= lobe;
  const float grazing = 1 - std::clamp(half.dot(to_viewer), 0.0f, 1.0f);
  const float power5 = grazing * grazing * grazing * grazing * grazing;
  return kPeak * lobe * (kNormalReflectance + (1 - kNormalReflectance) * power5);
}

}  // namespace sole::sim
