#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/colmap_exchange.h"
#include "app/commands.h"
#include "app/console.h"
#include "app/evaluate.h"
#include "core/error.h"
#include "io/calibration_file.h"
#include "io/rig_file.h"

namespace sole::app {
namespace {

using nlohmann::json;

struct ExchangeArguments {
  std::string from, format, rig, plate, out;
};

json RunExport(const ExchangeArguments& a) {
  const Rig rig = io::ReadCalibration(a.from).rig;
  const std::vector<std::string> below = ExportCalibrationToColmap(a.out, rig);
  if (!below.empty()) {
    Log(fmt::format("{} camera(s) below the glass are written as they stand; COLMAP does not know that they look through it: {}",
                    below.size(), fmt::join(below, ", ")));
  }
  return {{"model", a.out}, {"cameras", rig.cameras.size()}, {"below_glass", below}};
}

json RunImport(const ExchangeArguments& a) {
  const RigConfig config = io::ReadRigFile(a.rig);
  ImportedCalibration imported = ImportCalibrationFromColmap(a.from, config);
  Calibration& calibration = imported.calibration;
  if (!a.plate.empty()) {
    const Calibration earlier = io::ReadCalibration(a.plate);
    Require(earlier.rig.rig_hash == calibration.rig.rig_hash, a.plate + ": belongs to another rig than " + a.rig);
    calibration.rig.plate = earlier.rig.plate;
    calibration.ground = earlier.ground;
  }
  if (!imported.ignored.empty()) {
    Log(fmt::format("{} image(s) are of no camera of the rig and were left out, such as {}", imported.ignored.size(),
                    imported.ignored.front()));
  }
  Log("nobody has judged this calibration in millimetres: score it with `sole calibrate check TAKE --calibration " + a.out + "`");
  io::WriteCalibration(a.out, calibration);
  return {{"calibration", a.out}, {"cameras", calibration.rig.cameras.size()}, {"ignored", imported.ignored},
          {"reprojection_rms_px", calibration.stats.reprojection_rms_px}};
}

}  // namespace

void AddColmapCommands(CLI::App& calibrate, CommonOptions& common, int& status) {
  const auto a = std::make_shared<ExchangeArguments>();
  const auto print = [&common, &status](const json& account) {
    fmt::print("{}", common.json ? account.dump(2) + "\n" : FormatSummary(account));
    status = 0;
  };
  CLI::App* to = calibrate.add_subcommand("export", "Cameras of a calibration as a COLMAP model");
  to->footer("Example: sole calibrate export rig-calibration.json --to colmap --out model");
  to->add_option("CALIBRATION", a->from, "Calibration file")->required();
  to->add_option("--to", a->format, "Format: colmap (text model)")->required()->check(CLI::IsMember({"colmap"}));
  to->add_option("--out", a->out, "Folder of the model: cameras.txt, images.txt, points3D.txt")->required();
  to->callback([=] { print(RunExport(*a)); });

  CLI::App* from = calibrate.add_subcommand("import", "Calibration from a COLMAP model of the rig");
  from->footer("Example: sole calibrate import model --rig rig.toml --out rig-calibration.json\n"
               "The model is text, in the rig's world frame and metres, with one image SERIAL.png of every camera.");
  from->add_option("MODEL", a->from, "Folder of the model")->required();
  from->add_option("--rig", a->rig, "Rig file: cameras, pairs and the plate")->required();
  from->add_option("--plate", a->plate, "Calibration whose plate and ground surface are kept, instead of the rig file's nominal plate");
  from->add_option("--out", a->out, "Calibration file to write")->required();
  from->callback([=] { print(RunImport(*a)); });
}

}  // namespace sole::app
