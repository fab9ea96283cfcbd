#pragma once

#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "core/rig_config.h"
#include "core/target.h"

namespace sole::calib::testing_support {

/// A rig as it "really" is, drawn near the nominal one, and target poses. Test-only projection: the
/// path through the glass is found by bisection of the angle in air with Snell's law at each face,
/// sharing nothing with core/plate.h.
struct SyntheticRig {
  RigConfig config;
  double thickness_m = 0.015;
  double index = 1.52;
  std::vector<Rigid3> cam_from_world;
  std::vector<Eigen::Matrix<double, 8, 1>> lens;  ///< fx fy cx cy k1 k2 p1 p2
  std::vector<Rigid3> world_from_body;

  Eigen::Vector3d Centre(std::size_t c) const {
    return -(cam_from_world[c].rotation.conjugate() * cam_from_world[c].translation);
  }
};

/// Direction from `from` (below the glass) in which `to` (above it) appears, by Snell's law.
inline Eigen::Vector3d DirectionThroughGlass(const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                                             double thickness, double index) {
  const Eigen::Vector2d lateral = (to - from).head<2>();
  const double below = -thickness - from.z(), above = to.z();
  double low = 0, high = 1.56;
  for (int i = 0; i < 100; ++i) {
    const double angle = 0.5 * (low + high);
    const double inside = std::asin(std::sin(angle) / index);
    const double reach =
        below * std::tan(angle) + thickness * std::tan(inside) + above * std::tan(angle);
    (reach < lateral.norm() ? low : high) = angle;
  }
  const Eigen::Vector2d heading =
      lateral.norm() > 0 ? Eigen::Vector2d(lateral.normalized()) : Eigen::Vector2d(1, 0);
  return {std::sin(low) * heading.x(), std::sin(low) * heading.y(), std::cos(low)};
}

/// Pixel of a world point, by the test's own lens and Snell's law.
inline Eigen::Vector2d TruePixel(const SyntheticRig& rig, std::size_t c,
                                 const Eigen::Vector3d& point) {
  const Eigen::Vector3d centre = rig.Centre(c);
  const bool glass = centre.z() < 0;
  const Eigen::Vector3d direction =
      glass ? DirectionThroughGlass(centre, point, rig.thickness_m, rig.index)
            : Eigen::Vector3d(point - centre);
  const Eigen::Vector3d d = rig.cam_from_world[c].rotation * direction;
  const double x = d.x() / d.z(), y = d.y() / d.z(), r2 = x * x + y * y;
  const auto& l = rig.lens[c];
  const double radial = 1 + l[4] * r2 + l[5] * r2 * r2;
  const double u = x * radial + 2 * l[6] * x * y + l[7] * (r2 + 2 * x * x);
  const double v = y * radial + l[6] * (r2 + 2 * y * y) + 2 * l[7] * x * y;
  return {l[0] * u + l[2], l[1] * v + l[3]};
}

inline Rigid3 RandomTurn(std::mt19937_64& random, double angle_sd, double shift_sd) {
  std::normal_distribution<double> normal;
  Rigid3 turn;
  const Eigen::Vector3d w =
      angle_sd * Eigen::Vector3d(normal(random), normal(random), normal(random));
  turn.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(w.norm(), w.normalized()));
  turn.translation = shift_sd * Eigen::Vector3d(normal(random), normal(random), normal(random));
  return turn;
}

/// The default rig of four cameras and two more pairs that look through the glass at about 40
/// degrees.
inline RigConfig ObliqueRig() {
  RigConfig config = MakeDefaultRig(4);
  for (const double side : {-1.0, 1.0}) {
    for (const double along : {-0.06, 0.06}) {
      CameraConfig camera = config.cameras[0];
      camera.serial = "OBLIQUE" + std::to_string(config.cameras.size());
      camera.position_m = {side * 0.25, along, -0.25};
      camera.focal_px = 1500;
      camera.look_at_m = {0, 0, 0.03};
      camera.up = Eigen::Vector3d::UnitZ();
      config.cameras.push_back(camera);
    }
  }
  return config;
}

inline SyntheticRig MakeSyntheticRig(const RigConfig& config, int poses, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(-1, 1);
  SyntheticRig rig;
  rig.config = config;
  rig.thickness_m = rig.config.plate.thickness_m + 0.0003 * uniform(random);
  rig.index = rig.config.plate.index;
  for (const CameraConfig& camera : rig.config.cameras) {
    rig.cam_from_world.push_back(RandomTurn(random, 0.003, 0.002) * NominalCamFromWorld(camera));
    Eigen::Matrix<double, 8, 1> lens;
    lens << camera.focal_px * (1 + 0.005 * uniform(random)), 0,
        0.5 * camera.width + 10 * uniform(random), 0.5 * camera.height + 10 * uniform(random),
        -0.08 + 0.02 * uniform(random), 0.05 * uniform(random), 0.0003 * uniform(random),
        0.0003 * uniform(random);
    lens[1] = lens[0] * (1 + 0.0005 * uniform(random));
    rig.lens.push_back(lens);
  }
  for (int i = 0; i < poses; ++i) {
    const Eigen::Quaterniond heading(
        Eigen::AngleAxisd(3.14159265 * uniform(random), Eigen::Vector3d::UnitZ()));
    const Eigen::Quaterniond tilt(Eigen::AngleAxisd(
        0.6 * uniform(random), Eigen::Vector3d(uniform(random), uniform(random), 0).normalized()));
    rig.world_from_body.push_back(
        {tilt * heading,
         {0.06 * uniform(random), 0.12 * uniform(random), 0.10 + 0.02 * uniform(random)}});
  }
  return rig;
}

inline SyntheticRig MakeSyntheticRig(int cameras, int poses, std::uint64_t seed) {
  return MakeSyntheticRig(MakeDefaultRig(cameras), poses, seed);
}

/// Everything visible, with Gaussian noise: faces turned towards the camera, inside its image.
inline TakeObservations ObserveSynthetic(const SyntheticRig& rig, double noise_px,
                                         std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const CalibrationBody body =
      MakeCalibrationCube(rig.config.target.edge_m, rig.config.target.squares,
                          rig.config.target.square_m, rig.config.target.marker_m);
  const auto fiducials = FiducialCornerPoints(rig.config.plate);
  const double sigma = noise_px > 0 ? noise_px : 0.01;
  TakeObservations take;
  for (const Rigid3& world_from_body : rig.world_from_body) {
    auto& frame = take.frames.emplace_back(rig.config.cameras.size());
    for (std::size_t c = 0; c < frame.size(); ++c) {
      const auto add = [&](int point, const Eigen::Vector3d& world,
                           std::vector<PointObservation>& list) {
        const Eigen::Vector2d pixel =
            TruePixel(rig, c, world) + noise_px * Eigen::Vector2d(normal(random), normal(random));
        const CameraConfig& camera = rig.config.cameras[c];
        if (pixel.x() < 10 || pixel.y() < 10 || pixel.x() > camera.width - 11 ||
            pixel.y() > camera.height - 11)
          return;
        list.push_back({point, pixel, sigma});
      };
      int point = 0;
      for (const CharucoFace& face : body.faces) {
        const Eigen::Vector3d outward =
            -(world_from_body.rotation * face.body_from_board.rotation * Eigen::Vector3d::UnitZ());
        for (int k = 0; k < (face.squares_x - 1) * (face.squares_y - 1); ++k, ++point) {
          const Eigen::Vector3d world = world_from_body * CornerInBody(face, k);
          if ((rig.Centre(c) - world).normalized().dot(outward) > 0.25)
            add(point, world, frame[c].target);
        }
      }
      for (std::size_t k = 0; k < fiducials.size(); ++k)
        add(static_cast<int>(k), fiducials[k], frame[c].fiducials);
    }
  }
  return take;
}

}  // namespace sole::calib::testing_support
