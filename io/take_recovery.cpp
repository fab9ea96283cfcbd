#include "io/take_recovery.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>

#include "core/error.h"
#include "core/ranges.h"
#include "io/raw_recovery_internal.h"
#include "io/rig_file.h"
#include "io/take.h"
#include "io/take_timing_internal.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

/// A trigger number so far beyond the others is damage, whatever its checksum says.
constexpr std::int64_t kMaxJump = 100'000;

/// take.json, or what can be said without it.
TakeInfo InfoOf(const TakePaths& take, const RigConfig& config, bool& rebuilt) {
  try {
    return ReadTakeInfo(take);
  } catch (const Error&) {
    rebuilt = true;
    TakeInfo info;
    info.name = take.root.filename().string();
    info.subject = "unknown";
    info.rig_hash = RigIdentityHash(config);
    return info;
  }
}

std::vector<TriggerRecord> TriggersOf(const TakePaths& take, bool& unreadable) {
  try {
    return ReadTriggers(take);
  } catch (const Error&) {
    unreadable = true;
    return {};
  }
}

std::int64_t LastTrigger(const std::vector<RawRecord>& records) {
  std::int64_t last = 0;
  for (const RawRecord& record : records) last = std::max(last, record.header.trigger);
  return last;
}

/// Last trigger that the take answers for: frames that were on their way when it broke off are no
/// losses, a camera that had fallen silent long before is one.
std::int64_t LastJudged(const std::vector<std::vector<RawRecord>>& cameras, std::int64_t last,
                        const RigConfig& config) {
  std::int64_t whole = last;
  for (const auto& records : cameras) whole = std::min(whole, LastTrigger(records));
  const double second = std::max(
      2.0,
      std::ceil(config.trigger.rate_hz * static_cast<double>(config.trigger.exposures.size())));
  return static_cast<double>(last - whole) <= second ? whole : last;
}

std::string Frames(std::size_t count, std::int64_t of) {
  return std::to_string(count) + " of " + std::to_string(of) + " frames";
}

/// Verdict of a recovered take, and the reasons that its frames give.
void Judge(TakeRecovery& result, std::int64_t judged, double usable_loss) {
  if (judged < result.triggers) {
    result.reasons.push_back("broke off after trigger " + std::to_string(judged) +
                             ": of the later ones not every camera has a frame");
  }
  double worst = 0;
  for (const CameraRecovery& camera : result.cameras) {
    const std::string name = "camera " + camera.serial + ": ";
    const std::vector<std::int64_t>& lost = camera.lost_triggers;
    const auto counted = std::upper_bound(lost.begin(), lost.end(), judged) - lost.begin();
    if (judged > 0) {
      worst = std::max(
          worst, static_cast<double>(counted + camera.incomplete) / static_cast<double>(judged));
    }
    if (!lost.empty()) {
      result.reasons.push_back(name + Frames(lost.size(), result.triggers) + " lost (triggers " +
                               FormatRanges(lost) + ")");
    }
    if (camera.incomplete > 0) {
      result.reasons.push_back(
          name + Frames(static_cast<std::size_t>(camera.incomplete), result.triggers) +
          " incomplete (packets missing)");
    }
    if (camera.dropped > 0)
      result.reasons.push_back(name + std::to_string(camera.dropped) + " records were damaged");
  }
  result.verdict = judged == 0 || worst > usable_loss ? "repeat" : "usable";
}

CameraRecovery Summary(const std::string& serial, const RawRecovery& recovered) {
  CameraRecovery camera;
  camera.serial = serial;
  camera.kept = static_cast<std::int64_t>(recovered.records.size());
  camera.incomplete = std::count_if(recovered.records.begin(), recovered.records.end(),
                                    [](const RawRecord& r) { return r.header.status != 0; });
  camera.dropped = recovered.dropped;
  camera.torn = recovered.torn ? 1 : 0;
  camera.changed = recovered.changed;
  camera.damaged_copy = recovered.damaged_copy;
  return camera;
}

std::vector<std::int64_t> Lost(const std::vector<RawRecord>& records, std::int64_t last) {
  std::set<std::int64_t> held;
  for (const RawRecord& record : records) held.insert(record.header.trigger);
  std::vector<std::int64_t> lost;
  for (std::int64_t trigger = 1; trigger <= last; ++trigger) {
    if (!held.contains(trigger)) lost.push_back(trigger);
  }
  return lost;
}

std::int64_t CountRecords(const TakePaths& take, const RigConfig& config) {
  std::int64_t count = 0;
  for (const CameraConfig& camera : config.cameras) {
    const fs::path path = take.Raw(camera.serial);
    const fs::path file = fs::exists(path) ? path : fs::path(path.string() + ".partial");
    try {
      count += static_cast<std::int64_t>(ReadRawIndex(file).records.size());
    } catch (const Error&) {
      // Recovery will tell; this is for the progress bar.
    }
  }
  return count;
}

void RequireRaw(const TakePaths& take, const RigConfig& config) {
  for (const CameraConfig& camera : config.cameras) {
    const fs::path raw = take.Raw(camera.serial), archive = take.Archive(camera.serial);
    Require(!fs::exists(archive) || fs::exists(raw) || fs::exists(raw.string() + ".partial"),
            take.root.string() + " is archived: restore it with sole take archive --restore");
  }
}

}  // namespace

TakeRecovery RecoverTake(const fs::path& directory, const RecoverOptions& options) {
  const TakePaths take{directory};
  Require(fs::is_directory(directory),
          directory.string() + " is not a take: there is no such folder");
  Require(fs::exists(take.RigFile()),
          take.RigFile().string() +
              " is missing: put the rig file there that the take was recorded "
              "with, then recover again");
  const RigConfig config = ReadRigFile(take.RigFile());
  RequireRaw(take, config);
  bool rebuilt = false, unreadable = false;
  TakeInfo info = InfoOf(take, config, rebuilt);
  std::vector<TriggerRecord> triggers = TriggersOf(take, unreadable);
  const std::int64_t known = triggers.empty() ? 0 : triggers.back().trigger;

  TakeRecovery result;
  result.changed = rebuilt || unreadable || info.state == "recording";
  std::int64_t done = 0;
  const std::int64_t total = options.progress ? CountRecords(take, config) : 0;
  std::vector<std::vector<RawRecord>> cameras;
  for (const CameraConfig& camera : config.cameras) {
    const auto keep = [&](const fs::path& file, const RawRecord& record) {
      Require(options.stop == nullptr || !options.stop->load(),
              "stopped: " + directory.string() + " can be read and recovered again");
      if (options.progress) options.progress(++done, total);
      return record.header.width == static_cast<std::uint32_t>(camera.width) &&
             record.header.height == static_cast<std::uint32_t>(camera.height) &&
             record.header.trigger >= 0 && record.header.trigger <= known + kMaxJump &&
             CheckRawRecord(file, record);
    };
    const RawRecovery recovered = RecoverRawFile(take.Raw(camera.serial), camera.serial, keep);
    result.cameras.push_back(Summary(camera.serial, recovered));
    result.changed = result.changed || recovered.changed;
    cameras.push_back(recovered.records);
  }
  result.triggers = known;
  for (const auto& records : cameras)
    result.triggers = std::max(result.triggers, LastTrigger(records));
  for (std::size_t c = 0; c < cameras.size(); ++c)
    result.cameras[c].lost_triggers = Lost(cameras[c], result.triggers);
  const std::size_t lines = triggers.size();
  CompleteTriggers(triggers, result.triggers, config, cameras);
  result.added_triggers = static_cast<std::int64_t>(triggers.size() - lines);
  result.changed = result.changed || result.added_triggers > 0;
  if (result.changed) {
    result.reasons.push_back(info.state == "recording"
                                 ? "recovered: the recording was interrupted"
                                 : "recovered: files of the take were damaged");
    Judge(result, LastJudged(cameras, result.triggers, config), options.usable_loss);
    if (rebuilt) result.reasons.push_back("take.json could not be read and was made anew");
    if (unreadable)
      result.reasons.push_back("triggers.csv could not be read: its times are estimates");
    WriteTriggers(take, triggers);
    info.state = "recovered";
    info.verdict = result.verdict;
    info.reasons = result.reasons;
    WriteTakeInfo(take, info);
  }
  result.state = info.state;
  result.verdict = info.verdict;
  result.reasons = info.reasons;
  return result;
}

}  // namespace sole::io
