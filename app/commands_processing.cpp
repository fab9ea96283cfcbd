#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/console.h"
#include "app/evaluate.h"
#include "app/evaluate_model.h"
#include "app/export_colmap.h"
#include "app/stages.h"

namespace sole::app {
namespace {

using nlohmann::json;

struct Arguments {
  std::string take, calibration, out, model, format, dataset;
  EvaluateModelOptions evaluate;
  bool mesh = false, watertight = false;

  std::filesystem::path ModelPath() const { return model.empty() ? DefaultModelPath() : std::filesystem::path(model); }
};

/// A command that runs `body` within the cap on threads and prints the account it returns.
CLI::App* AddCommand(CLI::App& app, CommonOptions& common, int& status, const std::string& name,
                     const std::string& description, const std::string& example, const std::function<json()>& body) {
  CLI::App* command = app.add_subcommand(name, description);
  command->footer("Example: " + example);
  command->callback([body, &common, &status] {
    const ThreadCap cap(common.threads);
    const json account = body();
    fmt::print("{}", common.json ? account.dump(2) + "\n" : FormatSummary(account));
    status = 0;
  });
  return command;
}

}  // namespace

void AddProcessingCommands(CLI::App& app, CommonOptions& common, int& status) {
  const auto a = std::make_shared<Arguments>();
  const auto add_take = [a](CLI::App* command) { command->add_option("TAKE", a->take, "Directory of the take")->required(); };
  const auto add_model = [a](CLI::App* command) { command->add_option("--model", a->model, "Foot model; default: the shipped one"); };

  CLI::App* reconstruct = AddCommand(app, common, status, "reconstruct", "One point cloud (and mesh) per trigger",
                                     "sole reconstruct takes/S017 --calibration rig-calibration.json", [a] {
                                       return RunReconstruct(a->take, a->calibration,
                                                             a->watertight ? ScanMesh::kWatertight
                                                             : a->mesh     ? ScanMesh::kTrimmed
                                                                           : ScanMesh::kNone);
                                     });
  add_take(reconstruct);
  reconstruct->add_flag("--mesh", a->mesh, "Also a surface per trigger (scans/mesh), open where no camera saw the foot");
  reconstruct->add_flag("--watertight", a->watertight, "The same, closed everywhere");
  reconstruct->add_option("--calibration", a->calibration, "Calibration file")->required();

  add_take(AddCommand(app, common, status, "contact", "Ground surface of every frame", "sole contact takes/S017",
                      [a] { return RunContact(a->take); }));

  AddFitCommand(app, common, status);

  CLI::App* process = AddCommand(app, common, status, "process", "reconstruct, contact, fit, measure and export, only what is stale",
                                 "sole process takes/S017 --calibration rig-calibration.json",
                                 [a] { return RunProcess(a->take, a->calibration, a->ModelPath()); });
  add_take(process);
  add_model(process);
  process->add_option("--calibration", a->calibration, "Calibration file; default: the one the take was reconstructed with");

  CLI::App* measure = AddCommand(app, common, status, "measure", "Length, widths and heights of the fitted foot",
                                 "sole measure takes/S017", [a] { return RunMeasure(a->take, LoadModelPair(a->ModelPath())); });
  add_take(measure);
  add_model(measure);

  CLI::App* export_command = AddCommand(app, common, status, "export", "Files for others",
                                        "sole export takes/S017 --to glb", [a] {
                                          if (a->format == "colmap") return json{{"path", ExportColmap(a->take).string()}};
                                          json account;
                                          for (const auto& path : RunExport(a->take, LoadModelPair(a->ModelPath()), a->format)) {
                                            if (account.empty()) account["path"] = path.string();
                                            else account["further_feet"].push_back(path.string());
                                          }
                                          return account;
                                        });
  add_take(export_command);
  add_model(export_command);
  export_command->add_option("--to", a->format, fmt::format("Format: {}, colmap (workspaces of the scans)", fmt::join(ExportFormats(), ", ")))->required();

  CLI::App* evaluate = app.add_subcommand("evaluate", "Scores a processed simulated take against its truth, or a model on a dataset");
  evaluate->footer("Example: sole evaluate demo-out/take --json\n"
                   "         sole evaluate models/sole-foot.npz scans --plots evaluation.html");
  evaluate->add_option("WHAT", a->take, "Directory of a take, or a foot model")->required();
  evaluate->add_option("DATASET", a->dataset, "With a model: directory of a dataset of registrations");
  add_model(evaluate);
  evaluate->add_option("--split", a->evaluate.split, "Subjects of the dataset")->check(CLI::IsMember({"train", "validation", "test", "all"}))->capture_default_str();
  evaluate->add_option("--per-subject", a->evaluate.per_subject, "Registrations of a foot at most")->check(CLI::Range(1, 100000))->capture_default_str();
  evaluate->add_option("--baseline", a->evaluate.baseline, "Another model to score beside it");
  evaluate->add_option("--plots", a->evaluate.plots, "HTML page with tables and plots to write");
  evaluate->callback([a, &common, &status] {
    const ThreadCap cap(common.threads);
    const json account = a->dataset.empty() ? EvaluateTake(a->take, LoadModelPair(a->ModelPath()).right)
                                            : EvaluateModel(a->take, a->dataset, a->evaluate);
    fmt::print("{}", common.json ? account.dump(2) + "\n" : a->dataset.empty() ? FormatSummary(account) : FormatModelEvaluation(account));
    status = 0;
  });
}

void AddCommands(CLI::App& app, CommonOptions& common, int& status) {
  AddSimCommands(app, common, status);
  AddCaptureCommands(app, common, status);
  AddCalibrateCommands(app, common, status);
  AddTargetCommands(app, common, status);
  AddProcessingCommands(app, common, status);
  AddTakeCommands(app, common, status);
  AddMatchCommand(app, common, status);
  AddModelCommands(app, common, status);
  AddTrainCommand(app, common, status);
  AddDatasetCommands(app, common, status);
}

}  // namespace sole::app
