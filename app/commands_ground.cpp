#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/console.h"
#include "app/evaluate.h"
#include "app/ground.h"
#include "io/calibration_file.h"

namespace sole::app {

void AddGroundCommand(CLI::App& calibrate, CommonOptions& common, int& status) {
  struct Arguments {
    std::string take, calibration, out;
  };
  const auto a = std::make_shared<Arguments>();
  CLI::App* ground = calibrate.add_subcommand("ground", "Where the glass top is: from a take of the speckled sheet laid on it");
  ground->footer("Example: sole calibrate ground takes/sheet --calibration rig-calibration.json --out rig-calibration.json\n"
                 "The sheet's size and thickness stand in [sheet] of the rig file. Lay it flat, a few times, fiducials uncovered.");
  ground->add_option("TAKE", a->take, "Take of the contact sheet")->required();
  ground->add_option("--calibration", a->calibration, "Calibration file")->required();
  ground->add_option("--out", a->out, "Calibration file to write, with the ground")->required();
  ground->callback([=, &common, &status] {
    const ThreadCap cap(common.threads);
    Calibration calibration = io::ReadCalibration(a->calibration);
    const nlohmann::json account = AddGround(calibration, a->take);
    io::WriteCalibration(a->out, calibration);
    fmt::print("{}", common.json ? account.dump(2) + "\n" : FormatSummary(account));
    status = 0;
  });
}

}  // namespace sole::app
