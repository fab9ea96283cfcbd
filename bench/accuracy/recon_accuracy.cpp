// Reconstruction against truth, frame after frame as in a sequence. Usage:
//   bench_recon_accuracy take --seed N TAKE [--calibration FILE]   a take of `sole sim render --seed N`
//   bench_recon_accuracy sweep [--seed N] [--cameras 8] [--size 812x618]   noise, speckle, light
// Without a calibration the true rig of the seed takes its place. Seconds are CPU seconds of all
// threads and those on the clock. Prints Markdown tables.
#include <sys/resource.h>

#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/truth.h"
#include "bench/accuracy/recon_score.h"
#include "core/error.h"
#include "io/calibration_file.h"
#include "io/rig_file.h"
#include "io/take.h"
#include "recon/reconstruct.h"
#include "sim/motion.h"
#include "sim/reference_foot.h"
#include "sim/renderer.h"
#include "sim/subject.h"
#include "sim/visibility.h"

namespace {

using namespace sole;
using bench::RefSurface;
using bench::ReconScore;

double CpuSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// What a perfect calibration would say of the simulated rig.
Rig PerfectCalibration(const RigConfig& config, const sim::TrueRig& truth) {
  Rig rig;
  for (const sim::TrueCamera& c : truth.cameras) {
    Camera camera{c.serial, c.width, c.height, Intrinsics::Zero(), c.cam_from_world};
    camera.intrinsics << c.fx, c.fy, c.cx, c.cy, c.k1, c.k2, c.p1, c.p2, 0;
    rig.cameras.push_back(camera);
  }
  for (const PairConfig& p : config.pairs)
    rig.pairs.push_back({p.name, CameraIndex(config, p.left), CameraIndex(config, p.right)});
  rig.plate = {truth.plate.thickness_m, truth.plate.index};
  return rig;
}

ReconScore ScoreFor(const Rig& rig) {
  std::vector<bool> glass;
  for (const StereoPair& pair : rig.pairs)
    glass.push_back(
        LooksThroughPlate(rig.cameras[static_cast<std::size_t>(pair.left)], rig.plate));
  return ReconScore(glass);
}

constexpr const char* kColumns =
    "| {} | points | RMS mm | p95 mm | bias mm | glass RMS | glass bias | complete % | in volume % | outliers % | "
    "within sigma % | sigma mm | CPU s | s |\n|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n";

void PrintHeader(const std::string& first) { fmt::print(fmt::runtime(kColumns), first); }

/// `cpu_s`: of all threads; `seconds`: on the clock.
void PrintRow(const std::string& name, const ReconScore::Figures& f, double cpu_s, double seconds) {
  fmt::print("| {} | {:.0f} | {:.4f} | {:.4f} | {:+.4f} | {:.4f} | {:+.4f} | {:.2f} | {:.2f} | {:.3f} | {:.1f} | {:.4f} | {:.2f} | {:.2f} |\n",
             name, f.points, 1e3 * f.rms_m, 1e3 * f.p95_m, 1e3 * f.bias_m, 1e3 * f.glass_rms_m,
             1e3 * f.glass_bias_m, 100 * f.completeness, 100 * f.inside, 100 * f.outliers, 100 * f.within_sigma,
             1e3 * f.median_sigma_m, cpu_s, seconds);
  std::fflush(stdout);
}

void ScoreTake(const std::filesystem::path& directory, std::uint64_t seed,
               const std::string& calibration, bool cold, bool by_pair) {
  const io::TakeReader reader(directory, [](const std::string&) {});
  const app::TakeTruth truth = app::ReadTruth(directory);
  const Rig rig = calibration.empty()
                      ? PerfectCalibration(reader.Config(), sim::DrawTrueRig(reader.Config(), seed))
                      : io::ReadCalibration(calibration).rig;
  const recon::Reconstructor reconstructor(rig);
  ReconScore all = ScoreFor(rig);
  double total_cpu_s = 0, total_s = 0;
  recon::FrameSeeds seeds;
  PrintHeader("frame");
  for (std::size_t i = 0; i < reader.Triggers().size(); ++i) {
    const FrameSet frame = reader.Read(i);
    const double before = CpuSeconds();
    recon::FrameReconstruction result = reconstructor.Reconstruct(frame, cold ? nullptr : &seeds);
    const double cpu_s = CpuSeconds() - before;
    seeds = std::move(result.seeds);
    total_cpu_s += cpu_s;
    total_s += result.seconds;
    for (const app::FrameTruth& t : truth.frames) {
      if (t.trigger != frame.trigger) continue;
      const RefSurface surface{t.mesh, t.visible};
      ReconScore one = ScoreFor(rig);
      one.Add(surface, result.cloud);
      all.Add(surface, result.cloud);
      PrintRow(fmt::format("{}", frame.trigger), one.Result(), cpu_s, result.seconds);
    }
    if (!by_pair) continue;
    for (const recon::PairStats& p : result.pairs)
      fmt::print("  {:<14} tried {:6} matched {:6} kept {:6} in cloud {:6} zncc {:.4f} gap {:+.4f} px offset {:+.4f} mm {}{}\n",
                 p.name, p.tried, p.matched, p.kept, p.in_cloud, p.mean_zncc, p.median_gap_px, 1e3 * p.offset_m,
                 p.seeded ? "seeded " : "", p.skipped);
  }
  const auto frames = static_cast<double>(reader.Triggers().size());
  PrintRow("all", all.Result(), total_cpu_s / frames, total_s / frames);
}

struct Condition {
  std::string name;
  double noise = 1;
  double dot_px = 4;
  double ambient_light = 0.02;
  std::vector<int> dark_projectors = {};
};

/// A foot that stands, rendered under one condition and reconstructed with the true rig.
void ScoreCondition(const RigConfig& config, std::uint64_t seed, const Condition& condition) {
  const sim::TrueRig truth = sim::DrawTrueRig(config, seed);
  sim::RenderOptions options;
  options.noise = condition.noise;
  options.dot_px = condition.dot_px;
  options.ambient_light = condition.ambient_light;
  options.dark_projectors = condition.dark_projectors;
  options.seed = seed;
  const sim::Renderer renderer(config, truth, options);
  const sim::Subject subject = sim::DrawSubject(seed);
  sim::MotionOptions motion;
  motion.frames = 1;
  motion.seed = seed;
  const sim::FootMotion feet = sim::MakeMotion(subject, motion);
  sim::Scene scene;
  sim::SceneMesh foot;
  foot.mesh = {feet.frames[0].foot.foot.vertices_m, feet.triangles};
  foot.material = sim::ReferenceFoot().vertices;
  scene.meshes.push_back(foot);
  const sim::PreparedScene prepared = renderer.Prepare(scene);
  FrameSet frame;
  frame.trigger = 1;
  for (int c = 0; c < static_cast<int>(config.cameras.size()); ++c)
    frame.images.emplace_back(renderer.Render(prepared, c, seed + static_cast<std::uint64_t>(c)));
  const Rig rig = PerfectCalibration(config, truth);
  const recon::Reconstructor reconstructor(rig);
  const double before = CpuSeconds();
  const recon::FrameReconstruction result = reconstructor.Reconstruct(frame);
  const double cpu_s = CpuSeconds() - before;
  ReconScore score = ScoreFor(rig);
  score.Add({foot.mesh, sim::VisibleToPairs(renderer, prepared, 0, config.pairs)}, result.cloud);
  PrintRow(condition.name, score.Result(), cpu_s, result.seconds);
}

void Sweep(int cameras, int width, int height, std::uint64_t seed) {
  const RigConfig config = MakeDefaultRig(cameras, width, height);
  fmt::print("{} cameras of {} x {}, seed {}, true rig, one standing foot\n\n", cameras, width,
             height, seed);
  PrintHeader("condition");
  std::vector<Condition> conditions = {{.name = "default (noise 1, dots 4 px, room light 0.02)"}};
  for (const double noise : {0.0, 2.0, 5.0})
    conditions.push_back({.name = fmt::format("noise {:g}", noise), .noise = noise});
  for (const double dots : {2.0, 3.0, 6.0, 9.0})
    conditions.push_back({.name = fmt::format("dots of {:g} px", dots), .dot_px = dots});
  for (const double light : {0.0, 0.4, 1.2})
    conditions.push_back({.name = fmt::format("room light {:g}", light), .ambient_light = light});
  conditions.push_back({.name = "one projector above off", .dark_projectors = {0}});
  conditions.push_back({.name = "projectors below off", .dark_projectors = {4, 5}});
  conditions.push_back({.name = "all projectors off, skin texture in room light 1.2",
                        .ambient_light = 1.2,
                        .dark_projectors = {0, 1, 2, 3, 4, 5}});
  for (const Condition& condition : conditions) ScoreCondition(config, seed, condition);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Reconstruction against truth");
  app.require_subcommand(1);
  std::string directory, calibration, size = "812x618";
  std::uint64_t seed = 311;
  int cameras = 8;
  bool cold = false, by_pair = false;
  CLI::App* take = app.add_subcommand("take", "A rendered take");
  take->add_option("TAKE", directory)->required();
  take->add_option("--seed", seed, "Of its true rig")->required();
  take->add_option("--calibration", calibration);
  take->add_flag("--cold", cold, "No seeds from the frame before");
  take->add_flag("--pairs", by_pair, "What became of every pair");
  CLI::App* sweep = app.add_subcommand("sweep", "Noise, speckle and light");
  sweep->add_option("--seed", seed)->capture_default_str();
  sweep->add_option("--cameras", cameras)->capture_default_str();
  sweep->add_option("--size", size)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    int width = 0, height = 0;
    Require(std::sscanf(size.c_str(), "%dx%d", &width, &height) == 2, "--size: give WxH");
    if (take->parsed()) ScoreTake(directory, seed, calibration, cold, by_pair);
    else Sweep(cameras, width, height, seed);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  return 0;
}
