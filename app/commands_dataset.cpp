#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/console.h"
#include "app/dataset_info.h"
#include "app/register_dataset.h"

namespace sole::app {
namespace {

struct DatasetArguments {
  std::string dataset, model;
  std::vector<std::string> takes;
};

}  // namespace

void AddDatasetCommands(CLI::App& app, CommonOptions& common, int& status) {
  const auto a = std::make_shared<DatasetArguments>();
  CLI::App* dataset = app.add_subcommand("dataset", "Registrations of many subjects, for training");
  dataset->require_subcommand(1);

  CLI::App* add = dataset->add_subcommand("add", "Adds fitted takes under their subjects");
  add->footer("Example: sole dataset add feet takes/S017-walk takes/S017-stand\n"
              "Subjects are split into train, validation and test by their names alone.");
  add->add_option("DATASET", a->dataset, "Directory of the dataset; made if missing")->required();
  add->add_option("TAKE", a->takes, "Fitted takes")->required();
  add->add_option("--model", a->model, "Foot model they were fitted with; default: the shipped one");
  add->callback([a, &common, &status] {
    const ThreadCap cap(common.threads);
    const ModelPair models =
        LoadModelPair(a->model.empty() ? DefaultModelPath() : std::filesystem::path(a->model));
    nlohmann::json all = nlohmann::json::array();
    for (const std::string& take : a->takes) {
      all.push_back(AddTake(a->dataset, take, models));
      if (common.json) continue;
      const nlohmann::json& r = all.back();
      fmt::print("{}: subject {} ({}): {} takes, {} frames, {} good\n", take,
                 r["subject"].get<std::string>(), r["split"].get<std::string>(),
                 r["takes"].get<int>(), r["frames"].get<int>(), r["good"].get<int>());
    }
    if (common.json) fmt::print("{}\n", all.dump(2));
    status = 0;
  });

  CLI::App* info = dataset->add_subcommand("info", "Statistics of a dataset");
  info->footer("Example: sole dataset info feet");
  info->add_option("DATASET", a->dataset, "Directory of the dataset")->required();
  info->callback([a, &common, &status] {
    const ThreadCap cap(common.threads);
    const nlohmann::json account = DatasetInfo(a->dataset);
    fmt::print("{}", common.json ? account.dump(2) + "\n" : FormatDatasetInfo(account));
    status = 0;
  });
}

}  // namespace sole::app
