#include "sim/soft_contact.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>

#include "core/error.h"
#include "sim/reference_foot.h"
#include "sim/sole_columns_internal.h"
#include "sim/subject_shape.h"

namespace sole::sim {
namespace {

using Eigen::Vector3d;

constexpr double kContactGap = 1e-4;  // labels: contact below this gap

double VolumeOf(const std::vector<Vector3d>& vertices, const std::vector<Eigen::Vector3i>& triangles) {
  double volume = 0;
  for (const Eigen::Vector3i& t : triangles) {
    volume += vertices[static_cast<std::size_t>(t[0])].dot(
                  vertices[static_cast<std::size_t>(t[1])].cross(vertices[static_cast<std::size_t>(t[2])])) / 6;
  }
  return volume;
}

/// Displaced tissue spreads along the skin (screened diffusion of the shortening) and pushes it sideways; the amount restores
/// most of the volume that the plate took. Toes bulge little, they have room below.
void Bulge(const Subject& subject, const std::vector<double>& shortening, double volume_before,
           std::vector<Vector3d>& vertices) {
  constexpr double kReach2 = 100;      // squared reach in edges, about 15 mm
  constexpr double kRestored = 0.9;
  constexpr double kRound = 0.009;     // skin near the plate sticks to it, so the bulge is fullest above
  const ReferenceBinding& binding = Binding();
  std::vector<double> spread = shortening, next(spread.size());
  for (int pass = 0; pass < 150; ++pass) {
    for (std::size_t v = 0; v < spread.size(); ++v) {
      double sum = 0;
      for (const int n : binding.neighbours[v]) sum += spread[static_cast<std::size_t>(n)];
      next[v] = (shortening[v] + kReach2 * sum / static_cast<double>(binding.neighbours[v].size())) / (1 + kReach2);
    }
    spread.swap(next);
  }
  const auto& triangles = FootTriangles(subject.side);
  const std::vector<Vector3d> normals = VertexNormals({vertices, triangles});
  std::vector<Vector3d> push(vertices.size(), Vector3d::Zero()), trial = vertices;
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    if (binding.kinds[v] != SkinKind::kSkin) continue;
    const double toe = static_cast<double>(binding.shares.row(static_cast<Eigen::Index>(v)).tail<14>().sum());
    const double rise = std::clamp(vertices[v].z() / kRound, 0.0, 1.0);
    const double free = 0.08 + 0.92 * rise * rise * (3 - 2 * rise);
    push[v] = (1 - 0.85 * toe) * free * spread[v] * Vector3d(normals[v].x(), normals[v].y(), 0);
    trial[v] += push[v];
  }
  const double laid = VolumeOf(vertices, triangles), gained = VolumeOf(trial, triangles) - laid;
  const double amount = gained > 0 ? std::clamp(kRestored * (volume_before - laid) / gained, 0.0, 20.0) : 0;
  for (std::size_t v = 0; v < vertices.size(); ++v) vertices[v] += amount * push[v];
}

void Place(const Rigid3& motion, PosedFoot& foot) {
  for (Vector3d& v : foot.vertices_m) v = motion * v;
  for (Rigid3& bone : foot.world_from_rest) bone = motion * bone;
}

LoadedFoot Unloaded(PosedFoot foot) {
  LoadedFoot loaded;
  const std::size_t n = foot.vertices_m.size();
  loaded.contact.assign(n, 0);
  loaded.penetration_m.assign(n, 0);
  loaded.pressure_pa.assign(n, 0);
  loaded.load_n.assign(n, 0);
  loaded.foot = std::move(foot);
  return loaded;
}

}  // namespace

LoadedFoot PressOnPlate(const Subject& subject, const FootPose& pose, const ContactOptions& options) {
  LoadedFoot loaded = Unloaded(PoseFoot(subject, pose));
  std::vector<Vector3d>& vertices = loaded.foot.vertices_m;
  if (options.load_n <= 0) {
    double lowest = 0;
    for (const Vector3d& v : vertices) lowest = std::min(lowest, v.z());
    if (lowest < 0) Place({Eigen::Quaterniond::Identity(), Vector3d(0, 0, kContactGap - lowest)}, loaded.foot);
    loaded.balanced = true;
    return loaded;
  }
  Sole sole(subject, vertices, pose.world_from_foot.rotation, true);
  const Solution solution = SolveOnBendingPlate(options, sole, loaded.sag);
  Place(solution.motion, loaded.foot);
  loaded.balanced = solution.balanced;
  const auto sag_at = [&](std::size_t v) { return loaded.sag.At(vertices[v].x(), vertices[v].y()); };
  for (const Plantar& p : sole.Points()) {
    const auto v = static_cast<std::size_t>(p.vertex);
    loaded.penetration_m[v] = PenetrationOf(vertices[v].z() + sag_at(v));
    loaded.pressure_pa[v] = PressureOf(p.column, loaded.penetration_m[v]);
    loaded.load_n[v] = loaded.pressure_pa[v] * p.area_m2;
    loaded.total_load_n += loaded.load_n[v];
    loaded.pressure_centre_m += loaded.load_n[v] * vertices[v].head<2>();
    if (loaded.load_n[v] > 0) loaded.contact_area_m2 += p.area_m2;
  }
  if (loaded.total_load_n > 0) loaded.pressure_centre_m /= loaded.total_load_n;
  const double volume = VolumeOf(vertices, FootTriangles(subject.side));
  std::vector<double> shortening(vertices.size());
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    const double sag = sag_at(v), height = LaidHeight(vertices[v].z() + sag);
    shortening[v] = height - sag - vertices[v].z();
    vertices[v].z() = height - sag;
    loaded.contact[v] = height < kContactGap ? 1 : 0;
  }
  Bulge(subject, shortening, volume, vertices);
  // What slid sideways by a fraction of a millimetre is laid on the glass again.
  for (std::size_t v = 0; v < vertices.size(); ++v) {
    if (vertices[v].z() < kSoftening_m) vertices[v].z() = std::max(vertices[v].z(), -sag_at(v));
  }
  return loaded;
}

void LowerArch(double share, FootPose& pose) {
  pose.angles_rad["midtarsal.dorsiflexion"] = 0.087 * (1 - std::exp(-2.5 * share));
  pose.angles_rad["subtalar.inversion"] = -0.035 * share;
  for (int ray = 1; ray <= 5; ++ray) {
    pose.angles_rad["tarsometatarsal_" + std::to_string(ray) + ".dorsiflexion"] = 0.015 * share;
  }
}

void ReachForGround(const Subject& subject, const ContactOptions& options, double sink_m, FootPose& pose) {
  const Sole sole(subject, CarryFoot(subject, pose).vertices_m, pose.world_from_foot.rotation, false);
  const Solution ground = SolveBalance(sole, options);
  LowerToes(subject, (ground.motion * pose.world_from_foot).Inverse(), sink_m, pose);
}

FootPose LoadedStandingPose(const Subject& subject, double load_n, double pressure_centre_y) {
  constexpr double kGravity = 9.81;
  const double share = std::clamp(load_n / (subject.weight_kg * kGravity), 0.0, 1.2);
  FootPose pose;
  pose.world_from_foot = StandingPlacement(subject);
  LowerArch(share, pose);
  // The pulps give way, so they sink only a little.
  ReachForGround(subject, {.load_n = load_n, .pressure_centre_y = pressure_centre_y, .pressure_centre_x_m = {}},
                 0.0016 + 0.0018 * share, pose);
  return pose;
}

LoadedFoot StandOnPlate(const Subject& subject, double load_n, double pressure_centre_y) {
  Require(load_n > 0, "StandOnPlate: the load must be positive; use PressOnPlate with load 0 for the air");
  return PressOnPlate(subject, LoadedStandingPose(subject, load_n, pressure_centre_y),
                      {.load_n = load_n, .pressure_centre_y = pressure_centre_y, .pressure_centre_x_m = {}});
}

}  // namespace sole::sim
