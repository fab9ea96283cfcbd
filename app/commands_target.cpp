#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/evaluate.h"
#include "app/target_files.h"
#include "io/rig_file.h"

namespace sole::app {

void AddTargetCommands(CLI::App& app, CommonOptions& common, int& status) {
  struct Arguments {
    std::string kind, out, rig, page = "auto";
    double paper_mm = 0.1;
  };
  const auto a = std::make_shared<Arguments>();
  CLI::App* target = app.add_subcommand("target", "Calibration targets");
  target->require_subcommand(1);
  CLI::App* print = target->add_subcommand("print", "Draws a target true to scale: PDF, SVG, coordinates, and the cube's body for a 3-D printer");
  print->footer(
      "KIND is cube (sizes: [target] of the rig file), sheet (the speckled contact sheet: [sheet]), chessboard:9x6:25mm (inner corners), charuco:7x5:30mm:22mm:5X5_250 (squares)\n"
      "or aprilgrid:6x6:35mm:0.3 (tags; gap over tag), as `sole calibrate --images --target` takes it.\n"
      "Example: sole target print charuco:7x5:30mm:22mm --out print\n"
      "         sole target print cube --rig rig.toml --out print\n"
      "Print at 100 % and measure the scale bar; what it has too much or too little goes into the sizes.");
  print->add_option("KIND", a->kind, "What to draw")->required();
  print->add_option("--out", a->out, "Folder for the files")->required();
  print->add_option("--page", a->page, "auto (the smallest that holds it), A4, A3, A2, A1, A0 or WIDTHxHEIGHT in mm")->capture_default_str();
  print->add_option("--rig", a->rig, "Rig file with the sizes of cube and sheet; default: those of a new rig file");
  print->add_option("--paper", a->paper_mm, "Thickness of the sheets glued on the cube's body, mm")->check(CLI::Range(0.0, 10.0))->capture_default_str();
  print->callback([=, &common, &status] {
    const RigConfig rig = a->rig.empty() ? RigConfig{} : io::ReadRigFile(a->rig);
    const nlohmann::json account = PrintTarget(a->kind, rig, a->out, {a->page, 0.001 * a->paper_mm});
    fmt::print("{}", common.json ? account.dump(2) + "\n" : FormatSummary(account));
    status = 0;
  });
}

}  // namespace sole::app
