// Calibration of a simulated take against the rig that was simulated.
// usage: bench_calibration TAKE --seed S [--no-plate]
// TAKE: calibration take (of sole demo, or of sole sim render --calibration) made with --seed S.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <cmath>
#include <vector>

#include "app/take_list.h"
#include "calib/calibrate.h"
#include "core/error.h"
#include "sim/true_rig.h"

namespace sole::bench {
namespace {

/// Angle in degrees.
double Angle(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / M_PI;
}

/// Direction in the camera of the pixel in the middle of the image, lens distortion included.
Eigen::Vector3d MiddleInCamera(const Camera& camera) {
  return NormalizedFromPixel(camera.intrinsics,
                             {0.5 * (camera.width - 1), 0.5 * (camera.height - 1)})
      .homogeneous();
}

Camera TrueCameraOf(const sim::TrueCamera& c) {
  Camera camera{c.serial, c.width, c.height, {}, c.cam_from_world};
  camera.intrinsics << c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, 0;
  return camera;
}

/// Centres and directions of all cameras after a rigid alignment of the centres. Of the directions the optical
/// axis trades places with the principal point; the ray of the image's middle is what is measured.
void PrintPoses(const Rig& rig, const sim::TrueRig& truth) {
  const auto n = static_cast<Eigen::Index>(rig.cameras.size());
  Eigen::Matrix3Xd found(3, n), right(3, n);
  for (Eigen::Index c = 0; c < n; ++c) {
    found.col(c) = rig.cameras[static_cast<std::size_t>(c)].CentreInWorld();
    right.col(c) = truth.cameras[static_cast<std::size_t>(c)].Centre();
  }
  const Eigen::Matrix4d to_truth = Eigen::umeyama(found, right, false);
  const Eigen::Matrix3d turn = to_truth.topLeftCorner<3, 3>();
  double centres = 0, worst = 0, unaligned = 0, axes = 0, middles = 0, worst_axis = 0,
         worst_middle = 0;
  for (Eigen::Index c = 0; c < n; ++c) {
    const Camera& camera = rig.cameras[static_cast<std::size_t>(c)];
    const Camera real = TrueCameraOf(truth.cameras[static_cast<std::size_t>(c)]);
    const double centre =
        (to_truth.topLeftCorner<3, 4>() * found.col(c).homogeneous() - right.col(c)).norm();
    centres += centre * centre;
    worst = std::max(worst, centre);
    unaligned += (found.col(c) - right.col(c)).squaredNorm();
    const Eigen::Quaterniond world_from_found = camera.cam_from_world.rotation.conjugate(),
                             world_from_real = real.cam_from_world.rotation.conjugate();
    const double axis = Angle(turn * (world_from_found * Eigen::Vector3d::UnitZ()),
                              world_from_real * Eigen::Vector3d::UnitZ());
    const double middle = Angle(turn * (world_from_found * MiddleInCamera(camera)),
                                world_from_real * MiddleInCamera(real));
    axes += axis * axis;
    middles += middle * middle;
    worst_axis = std::max(worst_axis, axis);
    worst_middle = std::max(worst_middle, middle);
  }
  const auto rms = [n](double squares) { return std::sqrt(squares / static_cast<double>(n)); };
  fmt::print("camera centres, aligned: RMS {:.4f} mm, worst {:.4f} mm; in the world frame: RMS {:.4f} mm\n",
             1e3 * rms(centres), 1e3 * worst, 1e3 * rms(unaligned));
  fmt::print("optical axes, aligned: RMS {:.5f} degrees, worst {:.5f}\n", rms(axes), worst_axis);
  fmt::print("rays of the images' middles, aligned: RMS {:.5f} degrees, worst {:.5f}\n",
             rms(middles), worst_middle);
}

int Run(const std::string& path, std::uint64_t seed, bool no_plate) {
  app::TakeList take({path});
  const RigConfig& config = take.Config();
  calib::CalibrateOptions options;
  options.ignore_plate = no_plate;
  const calib::TakeObservations seen = calib::Observe(config, take, options.detect);
  const Calibration calibration = calib::CalibrateFromObservations(config, seen, options);
  const CalibrationStats& s = calibration.stats;
  fmt::print("poses: {} used, {} held out; reprojection RMS {:.4f} px\n", s.poses_used,
             s.poses_heldout, s.reprojection_rms_px);
  fmt::print("held-out distances: air {:.4f}, glass {:.4f}, across {:.4f}, max {:.4f} mm; {} points, "
             "{} rejected\n",
             s.heldout_rms_air_mm, s.heldout_rms_glass_mm, s.heldout_rms_across_mm,
             s.heldout_max_mm, s.heldout_points, s.heldout_rejected);
  PrintPoses(calibration.rig, sim::DrawTrueRig(config, seed));
  for (const std::string& failure : s.failures) fmt::print("FAILS: {}\n", failure);
  return 0;
}

}  // namespace
}  // namespace sole::bench

int main(int argc, char** argv) {
  CLI::App program("Calibration of a simulated take against the rig that was simulated");
  std::string take;
  std::uint64_t seed = 1;
  bool no_plate = false;
  program.add_option("TAKE", take, "Calibration take")->required();
  program.add_option("--seed", seed, "Seed that it was made with")->required();
  program.add_flag("--no-plate", no_plate, "Calibrates as if there were no glass");
  CLI11_PARSE(program, argc, argv);
  try {
    return sole::bench::Run(take, seed, no_plate);
  } catch (const sole::Error& error) {
    fmt::print(stderr, "bench_calibration: {}\n", error.what());
    return 1;
  }
}
