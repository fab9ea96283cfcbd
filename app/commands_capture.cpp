#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/console.h"
#include "app/epipolar.h"
#include "app/interrupt.h"
#include "app/keyboard.h"
#include "app/live_table.h"
#include "app/pseudonym.h"
#include "app/view_server.h"
#include "capture/recorder.h"
#include "capture/rig_check.h"
#include "capture/rig_draft.h"
#include "core/error.h"
#include "io/calibration_file.h"
#include "io/rig_file.h"

namespace sole::app {
namespace {

using nlohmann::json;

void PrintFindings(const std::vector<capture::RigFinding>& findings) {
  for (const auto& f : findings) {
    fmt::print("{:<8}{:<12}{}{}\n", capture::ToString(f.severity), f.camera, f.what,
               f.mend.empty() ? "" : ": " + f.mend);
  }
}

json ToJson(const std::vector<capture::RigFinding>& findings) {
  json list = json::array();
  for (const auto& f : findings) {
    list.push_back({{"severity", capture::ToString(f.severity)}, {"camera", f.camera},
                    {"what", f.what}, {"mend", f.mend}});
  }
  return list;
}

int InitRigCommand(const std::string& out, const capture::RigDraftOptions& options,
                   const CommonOptions& common) {
  Require(!std::filesystem::exists(out), out + " exists: choose another --out, nothing is overwritten");
  const capture::RigDraft draft = capture::DraftRig(options);
  io::WriteRigFile(out, draft.config);
  if (common.json) {
    fmt::print("{}\n", json{{"rig", out}, {"cameras", draft.config.cameras.size()},
                            {"findings", ToJson(draft.findings)}}
                           .dump(2));
  } else {
    PrintFindings(draft.findings);
    fmt::print("wrote {} with {} cameras\n", out, draft.config.cameras.size());
  }
  return 0;
}

int CheckRigCommand(const std::string& rig, const std::string& disk, const CommonOptions& common) {
  const capture::RigCheckResult result =
      capture::CheckRig(io::ReadRigFile(rig), {.disk = disk, .log = Log});
  if (common.json) {
    json cameras = json::array();
    for (const auto& c : result.cameras) {
      cameras.push_back({{"serial", c.serial}, {"found", c.found}, {"controlled", c.controlled},
                         {"settings_ok", c.settings_ok}, {"fired", c.fired}, {"answered", c.answered},
                         {"latency_max_s", c.latency_max_s}, {"resent_packets", c.resent_packets},
                         {"missing_packets", c.missing_packets}});
    }
    fmt::print("{}\n", json{{"ok", result.Ok()}, {"cameras", cameras}, {"findings", ToJson(result.findings)},
                            {"disk_bytes_per_s", result.disk_bytes_per_s},
                            {"needed_bytes_per_s", result.needed_bytes_per_s}}
                           .dump(2));
  } else {
    PrintFindings(result.findings);
  }
  return result.Ok() ? 0 : 1;
}

struct RecordArguments {
  std::string rig;
  capture::RecordOptions options;
  bool texture = false;
  bool allow_name = false;
  bool silent = false;
  bool no_image_check = false;
  std::string start = "now";
  std::string stop;
  std::string calibration;
  std::optional<int> view;
};

json ToJson(const capture::RecordResult& result) {
  json cameras = json::array();
  for (const capture::CameraRecord& c : result.cameras) {
    json gaps = json::array();
    for (const capture::CameraGap& gap : c.gaps) {
      gaps.push_back({{"after_trigger", gap.after_trigger}, {"seconds", gap.seconds},
                      {"ended", gap.ended}, {"reopened", gap.reopened}});
    }
    cameras.push_back({{"serial", c.serial}, {"good", c.good}, {"incomplete", c.incomplete},
                       {"lost", c.lost}, {"lost_triggers", c.lost_triggers}, {"dropped", c.dropped},
                       {"strays", c.strays}, {"resent_packets", c.resent_packets},
                       {"latency_median_s", c.latency_median_s}, {"latency_max_s", c.latency_max_s},
                       {"clock_ppm", c.clock ? json(c.clock->ppm) : json(nullptr)}, {"gaps", gaps}});
  }
  return {{"state", result.state}, {"verdict", result.verdict}, {"reasons", result.reasons},
          {"triggers", result.triggers}, {"frames_expected", result.FramesExpected()},
          {"frames_good", result.FramesGood()}, {"frames_lost", result.FramesLost()},
          {"trigger_late_max_s", result.trigger_late_max_s}, {"cameras", cameras}};
}

/// One beep for start, two for stop, three for a fault; nothing where nobody hears it.
void Ring(capture::RecordEvent event) {
  if (!isatty(STDERR_FILENO)) return;
  const int count = event == capture::RecordEvent::kStart ? 1 : event == capture::RecordEvent::kStop ? 2 : 3;
  for (int i = 0; i < count; ++i) {
    if (i > 0) usleep(150000);
    std::fputc('\a', stderr);
    std::fflush(stderr);
  }
}

capture::RecordOptions OptionsFrom(const RecordArguments& a, const RigConfig& config) {
  capture::RecordOptions options = a.options;
  Require(a.allow_name || !LooksLikeFullName(options.subject),
          "--subject '" + options.subject +
              "' looks like a person's name: use a pseudonym such as S017, or --allow-name if it is one");
  options.software = Version();
  options.check_images = !a.no_image_check;
  if (a.texture) options.cycle = {ExposureKind::kTexture};
  if (a.start == "key") options.start = capture::StartOn::kKey;
  if (a.start == "foot") options.start = capture::StartOn::kFoot;
  options.stop_on_foot_off = a.stop == "foot";
  if (!a.calibration.empty()) {
    const Calibration calibration = io::ReadCalibration(a.calibration);
    Require(calibration.rig.rig_hash == RigIdentityHash(config),
            a.calibration + " was made for another rig: calibrate this one, or leave --calibration out");
    options.check = [rig = calibration.rig](const std::filesystem::path& take) {
      return CheckCalibration(take.string(), rig);
    };
  }
  return options;
}

int RecordCommand(const RecordArguments& a, const CommonOptions& common) {
  const RigConfig config = io::ReadRigFile(a.rig);
  capture::RecordOptions options = OptionsFrom(a, config);
  options.stop = StopOnInterrupt();
  std::optional<ViewServer> view;
  if (a.view) {
    view.emplace(*a.view);
    Log(fmt::format("live view: http://127.0.0.1:{}/", view->Port()));
    options.pictures = [&](const std::vector<ImageU8>& pictures) { view->Show(pictures); };
  }
  LiveTable table;
  options.log = [&](const std::string& line) { table.Say(line); };
  options.progress = [&](const capture::RecordProgress& p) {
    table.Show(p);
    if (view) view->Show(p);
  };
  if (!a.silent) options.on_event = Ring;
  std::optional<Keyboard> keyboard;
  if (a.start == "key" || a.stop == "key" || isatty(STDIN_FILENO)) {
    keyboard.emplace();
    options.key = [&] { return keyboard->Hit(); };
    Log(a.start == "key" ? "Enter or space starts, and stops again" : "Enter or space stops");
  }
  const capture::RecordResult result = capture::Record(config, options);
  keyboard.reset();
  if (common.json) {
    fmt::print("{}\n", ToJson(result).dump(2));
  } else {
    fmt::print("{}: {} of {} frames good, {} triggers, verdict {}\n", options.directory.string(),
               result.FramesGood(), result.FramesExpected(), result.triggers, result.verdict);
    for (const std::string& reason : result.reasons) fmt::print("  {}\n", reason);
  }
  return result.verdict == "repeat" ? 3 : 0;
}

void AddRecordCommand(CLI::App& app, CommonOptions& common, int& status) {
  CLI::App* record = app.add_subcommand("record", "Records a take");
  record->footer(
      "Example: sole record rig.toml --subject S017 --take takes/S017-walk-1 --frames 50\n"
      "Example: sole record rig.toml --subject S017 --take takes/S017-walk-2 --frames 0 --start foot "
      "--stop foot --calibration cal.json --view 8080\n"
      "Enter, space or q stops. Exit status 3: recorded, but the verdict is repeat.");
  auto a = std::make_shared<RecordArguments>();
  record->add_option("RIG", a->rig, "Rig file")->required();
  record->add_option("--take", a->options.directory, "Directory to record into; must not hold anything yet")->required();
  record->add_option("--subject", a->options.subject, "Pseudonym of the subject")->required();
  record->add_flag("--allow-name", a->allow_name, "Take --subject as it is, also if it looks like a name");
  record->add_option("--consent", a->options.consent, "What the subject agreed to, kept with the take");
  record->add_option("--notes", a->options.notes, "Notes, kept with the take");
  record->add_option("--frames", a->options.triggers, "Number of triggers; 0: until something else ends it")
      ->check(CLI::Range(0, 1000000))->capture_default_str();
  record->add_option("--seconds", a->options.seconds, "Longest time; 0: no limit")
      ->check(CLI::Range(0.0, 86400.0))->capture_default_str();
  record->add_option("--start", a->start, "now, key or foot (on the plate); the rig file's pre_roll_s is kept")
      ->check(CLI::IsMember({"now", "key", "foot"}))->capture_default_str();
  record->add_option("--stop", a->stop, "key or foot (off the plate), besides --frames and --seconds")
      ->check(CLI::IsMember({"key", "foot"}));
  record->add_flag("--texture", a->texture, "Texture light instead of the rig file's exposures (calibration takes)");
  record->add_option("--calibration", a->calibration, "Calibration to check for bumped cameras at the end");
  record->add_option("--reference", a->options.reference, "Earlier good take of this rig: tells a dark projector");
  record->add_flag("--no-image-check", a->no_image_check, "Judge the take without looking at its images");
  record->add_option("--view", a->view, "Live pictures at http://127.0.0.1:PORT/; 0 takes a free port")
      ->check(CLI::Range(0, 65535));
  record->add_flag("--silent", a->silent, "No bell on start, stop and fault");
  record->callback([=, &common, &status] {
    const ThreadCap cap(common.threads);
    status = RecordCommand(*a, common);
  });
}

}  // namespace

void AddCaptureCommands(CLI::App& app, CommonOptions& common, int& status) {
  CLI::App* rig = app.add_subcommand("rig", "Looks after the rig");
  rig->require_subcommand(1);
  CLI::App* init = rig->add_subcommand("init", "Writes a rig file from the cameras found");
  init->footer("Example: sole rig init --out rig.toml");
  auto out = std::make_shared<std::string>("rig.toml");
  auto draft = std::make_shared<capture::RigDraftOptions>();
  init->add_option("--out", *out, "Rig file to write; must not exist")->capture_default_str();
  init->add_option("--serial", draft->serials, "Only these cameras, in this order; may be repeated");
  init->callback([=, &common, &status] { status = InitRigCommand(*out, *draft, common); });

  CLI::App* check = rig->add_subcommand("check", "Opens every camera, reads settings back, fires test triggers, says what is wrong");
  check->footer("Example: sole rig check rig.toml --disk takes");
  auto check_rig = std::make_shared<std::string>();
  auto disk = std::make_shared<std::string>(".");
  check->add_option("RIG", *check_rig, "Rig file")->required();
  check->add_option("--disk", *disk, "Directory that takes will be recorded into")->capture_default_str();
  check->callback([=, &common, &status] { status = CheckRigCommand(*check_rig, *disk, common); });

  AddRecordCommand(app, common, status);
}

}  // namespace sole::app
