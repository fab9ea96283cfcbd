#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "app/commands.h"
#include "app/console.h"
#include "app/interrupt.h"
#include "app/stages.h"
#include "app/train.h"

namespace sole::app {
namespace {

struct TrainArguments {
  std::string dataset, config, out, model_template;
  bool ablation = false, truth = false, print = false;
};

std::string Shown(const nlohmann::json& value) {
  return value.is_number() ? fmt::format("{:.3f}", value.get<double>()) : "-";
}

std::string FormatTraining(const nlohmann::json& account, const std::string& out) {
  std::string text = fmt::format("{}: {} subjects, {} registrations, {:.0f} s\n", out,
                                 account["train_subjects"].get<int>(),
                                 account["train_frames"].get<int>(),
                                 account["seconds"].get<double>());
  text += "validation subjects, v2v in mm   no contact   contact\n";
  for (const char* name : {"lbs", "linear", "f_theta", "f_theta_beta", "full"}) {
    if (!account["validation"].contains(name)) continue;
    const nlohmann::json& row = account["validation"][name];
    text += fmt::format("  {:30} {:>10} {:>9}\n", name, Shown(row["noncontact_mm"]),
                        Shown(row["contact_mm"]));
  }
  return text;
}

void TrainCommand(const TrainArguments& a, const CommonOptions& common) {
  TrainOptions options;
  if (!a.config.empty()) options.config = ReadTrainConfig(a.config);
  if (a.print) {
    fmt::print("{}", FormatTrainConfig(options.config));
    return;
  }
  options.model_template = a.model_template.empty() ? DefaultTemplatePath()
                                                    : std::filesystem::path(a.model_template);
  options.ablation = a.ablation;
  options.truth = a.truth;
  options.stop = StopOnInterrupt();
  const nlohmann::json account = TrainModel(a.dataset, a.out, options);
  fmt::print("{}", common.json ? account.dump(2) + "\n" : FormatTraining(account, a.out));
}

}  // namespace

void AddTrainCommand(CLI::App& app, CommonOptions& common, int& status) {
  const auto a = std::make_shared<TrainArguments>();
  CLI::App* train = app.add_subcommand("train", "Trains a foot model from a dataset's registrations");
  train->footer(
      "Example: sole train feet --out foot.npz --ablation\n"
      "Run again, it goes on where it was interrupted: every step leaves a file in foot.training/.\n"
      "Subjects of the split `test` are never read. Keys of the configuration: docs/formats.md.");
  train->add_option("DATASET", a->dataset, "Directory with registrations/ (sole fit, sole dataset add)")
      ->required();
  train->add_option("--config", a->config, "Configuration (TOML); every key has a default");
  train->add_option("--out", a->out, "Model to write (.npz)")->required();
  train->add_option("--template", a->model_template,
                    "Model that gives vertices, triangles, joint tree, landmarks and the priors of "
                    "weights and joints; default: the shipped one");
  train->add_flag("--ablation", a->ablation,
                  "Also train and write OUT-lbs, -linear, -f_theta and -f_theta_beta");
  train->add_flag("--truth", a->truth,
                  "Train on the simulator's vertices instead: the upper bound, for reports only");
  train->add_flag("--print-config", a->print, "Only print the configuration with all defaults");
  train->callback([a, &common, &status] {
    const ThreadCap cap(common.threads);
    TrainCommand(*a, common);
    status = 0;
  });
}

}  // namespace sole::app
