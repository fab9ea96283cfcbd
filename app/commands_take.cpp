// `sole take ...`: housekeeping of recordings.
#include <algorithm>
#include <charconv>
#include <memory>
#include <optional>
#include <string>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "app/commands.h"
#include "app/console.h"
#include "app/interrupt.h"
#include "app/take_extract.h"
#include "core/error.h"
#include "core/ranges.h"
#include "io/take.h"
#include "io/take_archive.h"
#include "io/take_check.h"
#include "io/take_recovery.h"

namespace sole::app {
namespace {

using nlohmann::json;

void Print(const json& result) { fmt::print("{}\n", result.dump(2, ' ', false, json::error_handler_t::replace)); }

/// A bar that learns its total with the first step.
class LateProgress {
 public:
  explicit LateProgress(std::string what) : what_(std::move(what)) {}
  void operator()(std::int64_t done, std::int64_t total) {
    if (!progress_) progress_.emplace(what_, static_cast<int>(total));
    progress_->Set(static_cast<int>(done));
  }
  void End() { progress_.reset(); }

 private:
  std::string what_;
  std::optional<Progress> progress_;
};

std::string CameraLine(const io::CameraRecovery& c, std::int64_t triggers) {
  std::string line = fmt::format("  {}: {} of {} records", c.serial, c.kept, triggers);
  if (c.torn > 0) line += ", one torn record cut off";
  if (c.dropped > 0) line += fmt::format(", {} damaged ones left out", c.dropped);
  if (c.incomplete > 0) line += fmt::format(", {} incomplete", c.incomplete);
  if (!c.lost_triggers.empty()) line += ", missing triggers: " + FormatRanges(c.lost_triggers, 1000);
  if (!c.damaged_copy.empty()) line += ", damaged original kept as " + c.damaged_copy.string();
  return line;
}

int Recover(const std::string& take, const CommonOptions& common) {
  LateProgress progress("check records");
  const io::TakeRecovery result =
      io::RecoverTake(take, {.progress = std::ref(progress), .stop = StopOnInterrupt()});
  progress.End();
  if (common.json) {
    json cameras = json::array();
    for (const io::CameraRecovery& c : result.cameras) {
      cameras.push_back({{"serial", c.serial},     {"records", c.kept},         {"incomplete", c.incomplete},
                         {"torn", c.torn},         {"damaged", c.dropped},      {"missing_triggers", c.lost_triggers},
                         {"changed", c.changed},   {"damaged_copy", c.damaged_copy.string()}});
    }
    Print({{"changed", result.changed},   {"state", result.state},       {"verdict", result.verdict},
           {"reasons", result.reasons},   {"triggers", result.triggers}, {"added_triggers", result.added_triggers},
           {"cameras", cameras}});
  } else if (!result.changed) {
    fmt::print("{}: nothing to recover: closed as {}, verdict {}, every record of {} triggers is sound\n", take,
               result.state, result.verdict.empty() ? "none" : result.verdict, result.triggers);
  } else {
    fmt::print("{}: recovered, {} triggers, verdict {}\n", take, result.triggers, result.verdict);
    for (const io::CameraRecovery& c : result.cameras) fmt::print("{}\n", CameraLine(c, result.triggers));
    if (result.added_triggers > 0)
      fmt::print("  {} triggers were added to triggers.csv, their times estimated from the cameras' clocks\n", result.added_triggers);
    for (const std::string& reason : result.reasons) fmt::print("  reason: {}\n", reason);
  }
  return 0;
}

json CamerasJson(const io::TakeCheck& check) {
  json cameras = json::array();
  for (const io::CameraCheck& c : check.cameras) {
    cameras.push_back({{"serial", c.serial}, {"storage", c.storage}, {"bytes", c.bytes}, {"records", c.records},
                       {"incomplete", c.incomplete}, {"missing_triggers", c.lost_triggers}, {"faults", c.faults}});
  }
  return cameras;
}

int Verify(const std::string& take, const CommonOptions& common) {
  LateProgress progress("check records");
  const io::TakeCheck check =
      io::CheckTake(take, {.threads = common.threads, .progress = std::ref(progress), .stop = StopOnInterrupt()});
  progress.End();
  std::int64_t records = 0;
  for (const io::CameraCheck& c : check.cameras) records += c.records;
  if (common.json) {
    Print({{"ok", check.Ok()}, {"triggers", check.triggers}, {"records", records}, {"faults", check.faults},
           {"cameras", CamerasJson(check)}});
  } else if (check.Ok()) {
    fmt::print("{}: sound: {} records of {} cameras and {} triggers match their checksums\n", take, records,
               check.cameras.size(), check.triggers);
  } else {
    for (const std::string& fault : check.faults) fmt::print("{}\n", fault);
  }
  return check.Ok() ? 0 : 1;
}

int Info(const std::string& take, const CommonOptions& common) {
  const io::TakeInfo info = io::ReadTakeInfo({take});
  const io::TakeCheck check = io::CheckTake(take, {.pixels = false});
  if (common.json) {
    Print({{"name", info.name}, {"subject", info.subject}, {"notes", info.notes}, {"created", info.created},
           {"software", info.software}, {"state", info.state}, {"verdict", info.verdict}, {"reasons", info.reasons},
           {"triggers", check.triggers}, {"cameras", CamerasJson(check)}, {"faults", check.faults}});
    return 0;
  }
  fmt::print("{}: subject {}, {}, {} triggers, state {}, verdict {}\n", info.name, info.subject, info.created, check.triggers,
             info.state, info.verdict.empty() ? "none" : info.verdict);
  if (!info.notes.empty()) fmt::print("  notes: {}\n", info.notes);
  for (const std::string& reason : info.reasons) fmt::print("  reason: {}\n", reason);
  for (const io::CameraCheck& c : check.cameras) {
    fmt::print("  {:<12} {:<8} {:>7} records, {:>4} incomplete, {:>4} missing, {:.1f} MB\n", c.serial, c.storage, c.records,
               c.incomplete, c.lost_triggers.size(), 1e-6 * static_cast<double>(c.bytes));
  }
  for (const std::string& fault : check.faults) fmt::print("  fault: {}\n", fault);
  return 0;
}

int Archive(const std::string& take, bool restore, io::TakeArchiveOptions options, const CommonOptions& common) {
  LateProgress progress(restore ? "restore" : "archive");
  options.progress = std::ref(progress);
  options.stop = StopOnInterrupt();
  options.threads = common.threads;
  const io::TakeArchiveResult result = restore ? io::RestoreTake(take, options) : io::ArchiveTake(take, options);
  progress.End();
  const double ratio = result.archive_bytes > 0
                           ? static_cast<double>(result.raw_bytes) / static_cast<double>(result.archive_bytes)
                           : 0;
  if (common.json) {
    Print({{"records", result.records}, {"raw_bytes", result.raw_bytes}, {"archive_bytes", result.archive_bytes},
           {"deleted_files", result.deleted}});
  } else {
    fmt::print("{}: {} frames {}, {:.1f} MB raw, {:.1f} MB archived ({:.2f} to 1), verified{}\n", take, result.records,
               restore ? "restored" : "archived", 1e-6 * static_cast<double>(result.raw_bytes),
               1e-6 * static_cast<double>(result.archive_bytes), ratio,
               result.deleted > 0 ? fmt::format(", {} source files deleted", result.deleted) : "");
  }
  return 0;
}

/// "7" or "3-9".
void ParseRange(const std::string& text, ExtractOptions& options) {
  if (text.empty()) return;
  const auto number = [&](const std::string& part) {
    std::int64_t value = 0;
    const auto [end, code] = std::from_chars(part.data(), part.data() + part.size(), value);
    Require(code == std::errc() && end == part.data() + part.size() && value >= 1,
            "--trigger " + text + ": give a trigger from 1 on, such as 7, or a range, such as 3-9");
    return value;
  };
  const std::size_t dash = text.find('-');
  options.first = number(text.substr(0, dash));
  options.last = dash == std::string::npos ? options.first : number(text.substr(dash + 1));
  Require(options.first <= options.last, "--trigger " + text + ": the range ends before it begins");
}

int Extract(const std::string& take, const std::string& range, ExtractOptions options, const CommonOptions& common) {
  ParseRange(range, options);
  LateProgress progress("extract");
  options.progress = std::ref(progress);
  options.stop = StopOnInterrupt();
  const ExtractResult result = ExtractTake(take, options);
  progress.End();
  if (common.json)
    Print({{"images", result.images}, {"absent", result.absent}, {"out", options.out.string()}});
  else
    fmt::print("{}: {} images, {} frames of the take are absent\n", options.out.string(), result.images, result.absent);
  return 0;
}

/// A sub-command that takes a take; `run` gives the exit status.
template <typename Run>
CLI::App* AddTakeCommand(CLI::App& parent, const char* name, const char* what, const char* footer, CommonOptions& common,
                         int& status, Run run) {
  CLI::App* command = parent.add_subcommand(name, what);
  command->footer(footer);
  auto take = std::make_shared<std::string>();
  command->add_option("TAKE", *take, "Directory of the take")->required();
  command->callback([=, &common, &status] {
    const ThreadCap cap(common.threads);
    status = run(*take);
  });
  return command;
}

}  // namespace

void AddTakeCommands(CLI::App& app, CommonOptions& common, int& status) {
  CLI::App* take = app.add_subcommand("take", "Housekeeping of recordings");
  take->require_subcommand(1);
  const auto with = [&common](auto function) { return [=, &common](const std::string& t) { return function(t, common); }; };
  AddTakeCommand(*take, "info", "What a take holds", "Example: sole take info takes/S017-walk-1", common, status, with(Info));
  AddTakeCommand(*take, "verify", "Reads every record and says what is damaged or contradicts itself",
                 "Example: sole take verify takes/S017-walk-1\nExit status 1: there are faults, one line each.", common,
                 status, with(Verify));
  AddTakeCommand(*take, "recover", "Makes a take whole whose recording was interrupted",
                 "Example: sole take recover takes/S017-walk-1\n"
                 "Keeps every record whose checksum holds and names the triggers that are missing. Can be repeated.",
                 common, status, with(Recover));

  auto archive_options = std::make_shared<io::TakeArchiveOptions>();
  auto restore = std::make_shared<bool>(false);
  CLI::App* archive = AddTakeCommand(
      *take, "archive", "Compresses the images without loss (FFV1 in Matroska), and back",
      "Example: sole take archive takes/S017-walk-1 --delete-source\n"
      "         sole take archive --restore takes/S017-walk-1\n"
      "What was written is read back and compared before any file is deleted. Any player opens the videos.",
      common, status,
      [=, &common](const std::string& t) { return Archive(t, *restore, *archive_options, common); });
  archive->add_flag("--restore", *restore, "Writes the raw files again, to the byte");
  archive->add_option("--out", archive_options->out, "Makes another take there instead of writing beside the source files");
  archive->add_flag("--delete-source", archive_options->delete_source, "Deletes the source files once the result is verified");

  auto extract_options = std::make_shared<ExtractOptions>();
  auto range = std::make_shared<std::string>();
  CLI::App* extract = AddTakeCommand(
      *take, "extract", "Writes images as files: OUT/SERIAL/000001.png",
      "Example: sole take extract takes/S017-walk-1 --to png --trigger 3-9 --out images", common, status,
      [=, &common](const std::string& t) { return Extract(t, *range, *extract_options, common); });
  extract->add_option("--to", extract_options->format, "png or tiff")->check(CLI::IsMember({"png", "tiff"}))->capture_default_str();
  extract->add_option("--camera", extract_options->cameras, "Serial; may be repeated; default: every camera")->allow_extra_args(false);
  extract->add_option("--trigger", *range, "One trigger or a range, such as 3-9; default: all");
  extract->add_option("--out", extract_options->out, "Directory for the images")->required();
}

}  // namespace sole::app
