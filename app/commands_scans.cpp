#include <map>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/console.h"
#include "app/interrupt.h"
#include "app/scans.h"
#include "core/error.h"

namespace sole::app {
namespace {

struct ScansArguments {
  ScanDatasetOptions options;
  std::string parameters;
  std::string out;
};

void ScansCommand(ScansArguments a, const CommonOptions& common) {
  const Stopwatch watch;
  if (!a.parameters.empty()) a.options.noise = sim::ReadScanNoise(a.parameters);
  a.options.stop = StopOnInterrupt();
  ScanDatasetResult result;
  {
    Progress progress("people", a.options.people);
    result = MakeScanDataset(a.out, a.options, [&](int done) { progress.Set(done); });
  }
  Require(!result.stopped,
          fmt::format("stopped: {} of {} people are in {}; the same command goes on", result.people,
                      a.options.people, a.out));
  const double seconds = watch.Seconds(), scans = static_cast<double>(result.scans);
  const nlohmann::json summary = {
      {"people", result.people},
      {"people_made", result.made},
      {"scans_made", result.scans},
      {"points_mean", result.scans > 0 ? nlohmann::json(static_cast<double>(result.points) / scans)
                                       : nlohmann::json(nullptr)},
      {"seconds", seconds}};
  fmt::print("{}",
             common.json
                 ? summary.dump(2) + "\n"
                 : fmt::format("{}: {} people, {} of them made now with {} scans in {:.0f} s\n",
                               a.out, result.people, result.made, result.scans, seconds));
}

}  // namespace

void AddScansCommand(CLI::App& sim, CommonOptions& common, int& status) {
  auto a = std::make_shared<ScansArguments>();
  CLI::App* scans = sim.add_subcommand(
      "scans", "True meshes and noisy partial clouds without images, for training");
  scans->footer(
      "Example: sole sim scans --people 100 --frames 10 --seed 1 --out scans\n"
      "Run again, it completes what was interrupted or adds people (docs/formats.md).");
  scans->add_option("--people", a->options.people, "People, one foot each")
      ->check(CLI::Range(1, 1000000))
      ->capture_default_str();
  scans->add_option("--frames", a->options.frames, "Scans of each person, on the plate and in the air, 12 or more of a motion")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  scans
      ->add_option("--points", a->options.points,
                   "Points of a scan at most; 0: as dense as reconstruction")
      ->check(CLI::Range(0, 1000000))
      ->capture_default_str();
  scans->add_option("--seed", a->options.seed, "Seed of the first person; the next ones follow")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 40))
      ->capture_default_str();
  scans
      ->add_option("--population", a->options.population,
                   "survey, or other: proportions and soles that the survey's people do not have")
      ->transform(CLI::CheckedTransformer(
          std::map<std::string, sim::Population>{{"survey", sim::Population::kSurvey},
                                                 {"other", sim::Population::kOther}}))
      ->option_text("survey|other");
  scans->add_option("--parameters", a->parameters,
                    "Noise parameters (JSON) instead of those that come with the program");
  scans->add_option("--out", a->out, "Directory of the dataset")->required();
  scans->callback([=, &common, &status] {
    const ThreadCap cap(common.threads);
    ScansCommand(*a, common);
    status = 0;
  });
}

}  // namespace sole::app
