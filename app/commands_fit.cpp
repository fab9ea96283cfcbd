#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/console.h"
#include "app/evaluate.h"
#include "app/fit_scan.h"
#include "app/interrupt.h"
#include "app/register_dataset.h"
#include "app/stages.h"
#include "core/error.h"

namespace sole::app {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<std::string> takes;
  std::string model, scan, units, up, out;
  bool floor = false;
};

nlohmann::json Run(const Arguments& a) {
  if (a.takes.empty() == a.scan.empty()) throw CLI::RequiredError("either TAKE or --scan");
  const ModelPair models = LoadModelPair(a.model.empty() ? DefaultModelPath() : fs::path(a.model));
  if (!a.scan.empty()) {
    ScanFitOptions options;
    if (!a.units.empty()) options.unit_m = a.units == "mm" ? 0.001 : 1;
    if (!a.up.empty()) options.up = a.up == "z" ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d::UnitY();
    options.floor = a.floor;
    return RunFitScan(a.scan, models, options, a.out);
  }
  if (!fs::exists(fs::path(a.takes[0]) / "dataset.json")) return RunFit({a.takes.begin(), a.takes.end()}, models);
  Require(a.takes.size() == 1, a.takes[0] + " is a dataset: fit it alone");
  std::unique_ptr<Progress> progress;
  return RegisterDataset(a.takes[0], models, {.stop = StopOnInterrupt()}, [&](int done, int all) {
    if (!progress) progress = std::make_unique<Progress>("people", all);
    progress->Set(done);
  });
}

}  // namespace

void AddFitCommand(CLI::App& app, CommonOptions& common, int& status) {
  const auto a = std::make_shared<Arguments>();
  CLI::App* fit = app.add_subcommand(
      "fit", "Registration, contact labels and model fit of a take, or the fit of another scanner's scan");
  fit->footer("Example: sole fit takes/S017 --model models/sole-foot.npz\n"
              "         sole fit --scan foot.stl --units mm");
  CLI::Option* take = fit->add_option("TAKE", a->takes, "Directory of the take; several of one subject share a shape; or of a dataset");
  CLI::Option* scan =
      fit->add_option("--scan", a->scan,
                      "Static scan of one foot by any scanner: .ply, .obj or .stl, mesh or points, in any position. "
                      "Writes NAME-fit.npz, .ply and .glb and prints measures")
          ->excludes(take);
  fit->add_option("--units", a->units, "Of the scan's numbers; default: told by its size")
      ->check(CLI::IsMember({"mm", "m"}))->needs(scan);
  fit->add_option("--up", a->up, "Axis of the scan that points up; default: found")
      ->check(CLI::IsMember({"z", "y"}))->needs(scan);
  fit->add_flag("--floor", a->floor,
                "The foot stands on a floor that is part of the scan: flat points below the foot are no skin. Soles that "
                "a program filled are found without")->needs(scan);
  fit->add_option("--out", a->out, "Folder for the scan's files; default: the scan's own")->needs(scan);
  fit->add_option("--model", a->model, "Foot model; default: the shipped one");
  fit->callback([a, &common, &status] {
    const ThreadCap cap(common.threads);
    const nlohmann::json account = Run(*a);
    fmt::print("{}", common.json ? account.dump(2) + "\n" : FormatSummary(account));
    status = 0;
  });
}

}  // namespace sole::app
