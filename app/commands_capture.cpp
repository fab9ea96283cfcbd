#include <memory>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/console.h"
#include "capture/recorder.h"
#include "capture/rig_check.h"
#include "io/rig_file.h"

namespace sole::app {
namespace {

using nlohmann::json;

int CheckRigCommand(const std::string& rig, const CommonOptions& common) {
  const capture::RigCheckResult result = capture::CheckRig(io::ReadRigFile(rig), {.log = Log});
  if (common.json) {
    json cameras = json::array(), findings = json::array();
    for (const auto& c : result.cameras) {
      cameras.push_back({{"serial", c.serial}, {"found", c.found}, {"controlled", c.controlled},
                         {"settings_ok", c.settings_ok}, {"fired", c.fired}, {"answered", c.answered},
                         {"latency_max_s", c.latency_max_s}, {"resent_packets", c.resent_packets},
                         {"missing_packets", c.missing_packets}});
    }
    for (const auto& f : result.findings) {
      findings.push_back({{"severity", capture::ToString(f.severity)}, {"camera", f.camera}, {"what", f.what}, {"mend", f.mend}});
    }
    fmt::print("{}\n", json{{"ok", result.Ok()}, {"cameras", cameras}, {"findings", findings}}.dump(2));
  } else {
    for (const auto& f : result.findings) {
      fmt::print("{:<8}{:<12}{}{}\n", capture::ToString(f.severity), f.camera, f.what, f.mend.empty() ? "" : ": " + f.mend);
    }
  }
  return result.Ok() ? 0 : 1;
}

int RecordCommand(const std::string& rig, capture::RecordOptions options, const CommonOptions& common) {
  const RigConfig config = io::ReadRigFile(rig);
  options.software = Version();
  options.stop = common.stop;
  options.log = Log;
  Progress progress("record", static_cast<int>(options.triggers));
  options.progress = [&](const capture::RecordProgress& p) { progress.Set(static_cast<int>(p.fired)); };
  const capture::RecordResult result = capture::Record(config, options);
  if (common.json) {
    fmt::print("{}\n", json{{"state", result.state}, {"verdict", result.verdict}, {"reasons", result.reasons},
                            {"triggers", result.triggers}, {"frames_expected", result.FramesExpected()},
                            {"frames_good", result.FramesGood()}, {"frames_lost", result.FramesLost()}}
                           .dump(2));
  } else {
    fmt::print("\n{}: {} of {} frames good, {} triggers, verdict {}\n", options.directory.string(), result.FramesGood(),
               result.FramesExpected(), result.triggers, result.verdict);
    for (const std::string& reason : result.reasons) fmt::print("  {}\n", reason);
  }
  return result.verdict == "repeat" ? 3 : 0;
}

}  // namespace

void AddCaptureCommands(CLI::App& app, CommonOptions& common, int& status) {
  CLI::App* rig = app.add_subcommand("rig", "Looks after the rig");
  rig->require_subcommand(1);
  CLI::App* check = rig->add_subcommand("check", "Opens every camera, reads settings back, fires test triggers, says what is wrong");
  check->footer("Example: sole rig check rig.toml");
  auto check_rig = std::make_shared<std::string>();
  check->add_option("RIG", *check_rig, "Rig file")->required();
  check->callback([=, &common, &status] { status = CheckRigCommand(*check_rig, common); });

  CLI::App* record = app.add_subcommand("record", "Records a take");
  record->footer("Example: sole record rig.toml --subject S017 --take takes/S017-walk-1 --frames 50\n"
                 "Exit status 3: recorded, but the verdict is repeat.");
  auto record_rig = std::make_shared<std::string>();
  auto options = std::make_shared<capture::RecordOptions>();
  auto texture = std::make_shared<bool>(false);
  record->add_option("RIG", *record_rig, "Rig file")->required();
  record->add_option("--take", options->directory, "Directory to record into; must not hold anything yet")->required();
  record->add_option("--subject", options->subject, "Pseudonym of the subject")->required();
  record->add_option("--notes", options->notes, "Notes, kept with the take");
  record->add_option("--frames", options->triggers, "Number of triggers")->check(CLI::Range(1, 1000000))->capture_default_str();
  record->add_flag("--texture", *texture, "Texture light instead of speckle (calibration takes)");
  record->callback([=, &common, &status] {
    const ThreadCap cap(common.threads);
    if (*texture) options->cycle = {ExposureKind::kTexture};
    status = RecordCommand(*record_rig, *options, common);
  });
}

}  // namespace sole::app
