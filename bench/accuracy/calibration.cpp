// Calibration of a simulated take against the rig that was simulated.
// usage: bench_calibration TAKE --seed S [--no-plate] [--worst N]
// TAKE: calibration take (of sole demo, or of sole sim render --calibration) made with --seed S.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <vector>

#include "app/take_list.h"
#include "calib/calibrate.h"
#include "calib/detect.h"
#include "calib/judge.h"
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

/// A corner as cameras of one side of the plate see it, and how far it is from where the body has it.
struct CornerError {
  double error_mm;
  std::size_t frame;
  int corner;
  std::string views;
};

/// The corners of all frames that are furthest from the body laid on the frame's corners.
void PrintWorst(const Rig& rig, const calib::TakeObservations& seen,
                const std::vector<Eigen::Vector3d>& body, std::size_t count) {
  std::vector<CornerError> errors;
  for (std::size_t f = 0; f < seen.frames.size(); ++f) {
    std::vector<CornerError> found;
    std::vector<Eigen::Vector3d> world, known;
    for (const bool below : {false, true}) {
      std::map<int, std::pair<std::vector<Ray>, std::string>> rays;
      for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
        if (LooksThroughPlate(rig.cameras[c], rig.plate) != below) continue;
        for (const calib::PointObservation& o : seen.frames[f][c].target) {
          auto& entry = rays[o.point];
          entry.first.push_back(RayFromPixel(rig.cameras[c], rig.plate, o.pixel));
          entry.second += fmt::format(" {} (sigma {:.3f} px)", rig.cameras[c].serial, o.sigma_px);
        }
      }
      for (const auto& [corner, entry] : rays) {
        if (entry.first.size() < 2) continue;
        world.push_back(calib::NearestPoint(entry.first));
        known.push_back(body[static_cast<std::size_t>(corner)]);
        found.push_back({0, f, corner, entry.second});
      }
    }
    if (found.size() < 4) continue;
    const auto n = static_cast<Eigen::Index>(found.size());
    Eigen::Matrix3Xd from(3, n), to(3, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      from.col(i) = known[static_cast<std::size_t>(i)];
      to.col(i) = world[static_cast<std::size_t>(i)];
    }
    const Eigen::Matrix4d pose = Eigen::umeyama(from, to, false);
    for (Eigen::Index i = 0; i < n; ++i) {
      CornerError& error = found[static_cast<std::size_t>(i)];
      error.error_mm = 1e3 * (pose.topLeftCorner<3, 4>() * from.col(i).homogeneous() - to.col(i)).norm();
      errors.push_back(error);
    }
  }
  std::sort(errors.begin(), errors.end(),
            [](const CornerError& a, const CornerError& b) { return a.error_mm > b.error_mm; });
  for (std::size_t i = 0; i < std::min(count, errors.size()); ++i)
    fmt::print("{:.4f} mm: pose {}, corner {}, seen by{}\n", errors[i].error_mm, errors[i].frame + 1,
               errors[i].corner, errors[i].views);
}

int Run(const std::string& path, std::uint64_t seed, bool no_plate, std::size_t worst) {
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
  PrintWorst(calibration.rig, seen, calib::TargetCorners(calib::TargetOf(config).body), worst);
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
  std::size_t worst = 0;
  program.add_option("TAKE", take, "Calibration take")->required();
  program.add_option("--seed", seed, "Seed that it was made with")->required();
  program.add_flag("--no-plate", no_plate, "Calibrates as if there were no glass");
  program.add_option("--worst", worst, "Corners with the largest errors to list");
  CLI11_PARSE(program, argc, argv);
  try {
    return sole::bench::Run(take, seed, no_plate, worst);
  } catch (const sole::Error& error) {
    fmt::print(stderr, "bench_calibration: {}\n", error.what());
    return 1;
  }
}
