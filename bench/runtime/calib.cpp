// Projection through the plate beside a generic iterative solver, and the whole adjustment of 20
// cameras and 30 poses on synthetic corners (after detection).
// usage: bench_calib [--benchmark_filter=REGEX]; CPU is what counts on a busy machine.
#include <benchmark/benchmark.h>
#include <ceres/tiny_solver.h>
#include <ceres/tiny_solver_autodiff_function.h>

#include <random>

#include "calib/calibrate.h"
#include "calib/refractive_cost_internal.h"
#include "calib/start_values.h"
#include "core/plate.h"
#include "tests/calib/synthetic_rig.h"

namespace sole::calib {
namespace {

Camera BelowCamera() {
  const CameraConfig config = MakeDefaultRig(20).cameras[8];  // oblique, below the glass
  Camera camera{"", config.width, config.height, {}, NominalCamFromWorld(config)};
  camera.intrinsics << 3250, 3251, 810, 615, -0.08, 0.05, 2e-4, -3e-4, 0;
  return camera;
}

std::vector<Eigen::Vector3d> Points() {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 1024; ++i) {
    points.emplace_back(0.09 * uniform(random), 0.18 * uniform(random),
                        0.08 + 0.08 * uniform(random));
  }
  return points;
}

/// Traces a ray surface by surface with Snell's law for vectors; the residual is its miss.
struct TracedMiss {
  Eigen::Vector3d centre, point;
  Plate plate;
  template <typename T>
  bool operator()(const T* slope, T* residual) const {
    using std::sqrt;
    const T length = sqrt(T(1) + slope[0] * slope[0] + slope[1] * slope[1]);
    const T inside_x = slope[0] / length / T(plate.index),
            inside_y = slope[1] / length / T(plate.index);
    const T inside_z = sqrt(T(1) - inside_x * inside_x - inside_y * inside_y);
    const double air = point.z() - centre.z() - plate.thickness_m;
    residual[0] = T(centre.x() - point.x()) + T(air) * slope[0] +
                  T(plate.thickness_m) * inside_x / inside_z;
    residual[1] = T(centre.y() - point.y()) + T(air) * slope[1] +
                  T(plate.thickness_m) * inside_y / inside_z;
    return true;
  }
};

Eigen::Vector2d PixelByGenericSolver(const Camera& camera, const Plate& plate,
                                     const Eigen::Vector3d& centre, const Eigen::Vector3d& point) {
  const TracedMiss miss{centre, point, plate};
  ceres::TinySolverAutoDiffFunction<TracedMiss, 2, 2> function(miss);
  ceres::TinySolver<ceres::TinySolverAutoDiffFunction<TracedMiss, 2, 2>> solver;
  solver.options.gradient_tolerance = 1e-16;
  solver.options.parameter_tolerance = 1e-14;
  solver.options.function_tolerance = 1e-16;
  solver.options.cost_threshold = 0;
  const Eigen::Vector3d straight = point - centre;
  Eigen::Vector2d slope = straight.head<2>() / straight.z();
  solver.Solve(function, &slope);
  return PixelFromPointInCam<double>(camera.intrinsics.data(),
                                     camera.cam_from_world.rotation * slope.homogeneous());
}

void ForwardProjection(benchmark::State& state) {
  const Camera camera = BelowCamera();
  const Plate plate;
  const Projector projector(camera, plate);
  const std::vector<Eigen::Vector3d> points = Points();
  std::vector<Eigen::Vector2d> pixels(points.size());
  projector(points, pixels);
  double worst = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d generic =
        PixelByGenericSolver(camera, plate, projector.centre, points[i]);
    worst = std::max(worst, (pixels[i] - generic).norm());
  }
  for (auto _ : state) {
    projector(points, pixels);
    benchmark::DoNotOptimize(pixels.data());
    benchmark::ClobberMemory();
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(points.size()));
  state.counters["worst_difference_px"] = worst;
}
BENCHMARK(ForwardProjection);

void ForwardProjectionGenericSolver(benchmark::State& state) {
  const Camera camera = BelowCamera();
  const Plate plate;
  const Eigen::Vector3d centre = camera.CentreInWorld();
  const std::vector<Eigen::Vector3d> points = Points();
  for (auto _ : state) {
    for (const auto& point : points) {
      benchmark::DoNotOptimize(PixelByGenericSolver(camera, plate, centre, point));
    }
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(points.size()));
}
BENCHMARK(ForwardProjectionGenericSolver);

/// One target corner with all derivatives, as the adjustment evaluates it.
void ResidualWithJacobians(benchmark::State& state) {
  const Camera camera = BelowCamera();
  const TargetCost cost({{800, 600}, 0.05, 1.52, camera.cam_from_world}, Rigid3{}, {0.01, 0.02, 0.1});
  const std::array<double, kPoseSize> zero{};
  const double thickness = 0.015;
  const double* blocks[] = {zero.data(), camera.intrinsics.data(), zero.data(), &thickness};
  double residual[2], by_camera[12], by_intrinsics[18], by_body[12], by_thickness[2];
  double* jacobians[] = {by_camera, by_intrinsics, by_body, by_thickness};
  for (auto _ : state) {
    cost.Evaluate(blocks, residual, jacobians);
    benchmark::DoNotOptimize(by_camera);
  }
}
BENCHMARK(ResidualWithJacobians);

/// Start values, adjustment and covariance; argument: cameras.
void CalibrateThirtyPoses(benchmark::State& state) {
  const auto rig =
      testing_support::MakeSyntheticRig(static_cast<int>(state.range(0)), 30, 1);
  const TakeObservations take = testing_support::ObserveSynthetic(rig, 0.05, 1);
  Calibration calibration;
  for (auto _ : state) calibration = CalibrateFromObservations(rig.config, take);
  int corners = 0;
  for (const int count : calibration.stats.camera_corners) corners += count;
  state.counters["corners"] = corners;
  state.counters["reprojection_px"] = calibration.stats.reprojection_rms_px;
  state.counters["heldout_air_mm"] = calibration.stats.heldout_rms_air_mm;
  state.counters["heldout_glass_mm"] = calibration.stats.heldout_rms_glass_mm;
}
BENCHMARK(CalibrateThirtyPoses)->Arg(4)->Arg(20)->Unit(benchmark::kMillisecond)->Iterations(1)
    ->MeasureProcessCPUTime();

}  // namespace
}  // namespace sole::calib

BENCHMARK_MAIN();
