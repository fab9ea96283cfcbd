// `sole fit --scan` on full-size scans of simulated people, turned anyhow, in millimetres: unloaded, standing, and
// standing with a filled sole.
// usage: bench_foreign_scan [--people N] [--seed S] [--kind rest,stand,filled]
#include <ctime>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/fit_scan.h"
#include "core/error.h"
#include "tests/support/foreign_scan.h"

namespace sole::bench {
namespace {

int Run(std::uint64_t seed, int people, const std::vector<std::string>& kinds) {
  const app::ModelPair models = app::LoadModelPair(app::DefaultModelPath());
  fmt::print("| kind | person | side | verdict | flat points | registered, mm: mean, worst | model, mm: mean, worst | "
             "CPU s |\n|---|---|---|---|---|---|---|---|\n");
  for (const std::string& kind : kinds) {
    for (int p = 0; p < people; ++p) {
      const std::uint64_t person = seed + static_cast<std::uint64_t>(p);
      const testing_support::ForeignScan scan = testing_support::MakeForeignScan(person, kind);
      const std::clock_t begin = std::clock();
      const app::ScanFit result = app::FitScan(scan.file, kind, models);
      const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
      const FrameFit& frame = result.fit.frames.front();
      const model::FootModel& model = frame.side == Side::kRight ? models.right : models.left;
      model::ModelParameters parameters{frame.theta, result.fit.beta, frame.translation_m, {}};
      const auto fine = model::Variant::kFine;
      const auto registered = testing_support::DistanceAboveSole(
          scan, model::MeshOf(model, fine, frame.registration_fine_m));
      const auto fitted = testing_support::DistanceAboveSole(
          scan, model::MeshOf(model, fine, model::Forward(model, parameters, fine).vertices_m));
      fmt::print("| {} | {} | {} | {} | {} | {:.3f}, {:.2f} | {:.3f}, {:.2f} | {:.1f} |\n", kind, person,
                 frame.side == scan.side ? "right one" : "WRONG", frame.verdict, result.flat_points,
                 registered.mean_mm, registered.worst_mm, fitted.mean_mm, fitted.worst_mm, seconds);
      std::fflush(stdout);
    }
  }
  return 0;
}

}  // namespace
}  // namespace sole::bench

int main(int argc, char** argv) {
  CLI::App program("Fits of full-size foreign scans against truth");
  std::uint64_t seed = 300;
  int people = 3;
  std::vector<std::string> kinds{"rest", "stand", "filled"};
  program.add_option("--seed", seed, "First person")->capture_default_str();
  program.add_option("--people", people, "People")->capture_default_str();
  program.add_option("--kind", kinds, "Kinds of scans")->delimiter(',');
  CLI11_PARSE(program, argc, argv);
  try {
    return sole::bench::Run(seed, people, kinds);
  } catch (const sole::Error& error) {
    fmt::print(stderr, "bench_foreign_scan: {}\n", error.what());
    return 1;
  }
}
