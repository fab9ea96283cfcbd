#include "io/take_check.h"

#include <array>
#include <mutex>
#include <set>
#include <utility>

#include "core/error.h"
#include "core/ranges.h"
#include "io/parallel_internal.h"
#include "io/raw_archive.h"
#include "io/raw_file.h"
#include "io/rig_file.h"
#include "io/shown_internal.h"
#include "io/take.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

/// Checks one camera's recording against the take.
class CameraChecker {
 public:
  CameraChecker(const TakePaths& take, const CameraConfig& camera,
                const std::vector<TriggerRecord>& triggers)
      : take_(take), camera_(camera) {
    result_.serial = camera.serial;
    for (const TriggerRecord& trigger : triggers) triggers_.insert(trigger.trigger);
  }

  /// Finds the file and reads its headers.
  void Open() {
    const std::array<std::pair<const char*, fs::path>, 3> places{
        {{"raw", take_.Raw(camera_.serial)},
         {"partial", take_.Raw(camera_.serial).string() + ".partial"},
         {"archive", take_.Archive(camera_.serial)}}};
    for (const auto& [storage, path] : places) {
      std::error_code error;
      if (!fs::exists(path, error)) continue;
      result_.storage = storage;
      path_ = path;
      result_.bytes = fs::file_size(path, error);
      break;
    }
    if (path_.empty()) {
      result_.storage = "missing";
      Fault(take_.Raw(camera_.serial).string() + ": is missing: run sole take recover");
      return;
    }
    try {
      index_ = Archived() ? ReadArchiveIndex(path_) : ReadRawIndex(path_);
      CheckIndex();
    } catch (const Error& error) {
      Fault(error.what());
    }
  }

  /// Reads every image; `step` after each.
  void CheckPixels(const std::function<void()>& step) {
    const auto judge = [&](std::size_t record, bool holds) {
      if (!holds)
        Fault(At(index_.records[record]) + "does not match its checksum: run sole take recover");
      step();
    };
    try {
      if (Archived()) {
        if (!index_.records.empty()) CheckArchive(path_, judge);
      } else {
        for (std::size_t i = 0; i < index_.records.size(); ++i)
          judge(i, CheckRawRecord(path_, index_.records[i]));
      }
    } catch (const Error& error) {
      if (stopped_ != nullptr && stopped_->load()) throw;
      Fault(error.what());
    }
  }

  std::int64_t Records() const { return static_cast<std::int64_t>(index_.records.size()); }
  CameraCheck& Result() { return result_; }
  void StopWhen(const std::atomic<bool>* stop) { stopped_ = stop; }

 private:
  bool Archived() const { return result_.storage == "archive"; }
  void Fault(const std::string& line) { result_.faults.push_back(line); }
  std::string At(const RawRecord& record) const {
    return path_.string() + ": record of trigger " + std::to_string(record.header.trigger) + " ";
  }

  void CheckIndex() {
    if (result_.storage == "partial")
      Fault(path_.string() + ": was not closed: run sole take recover");
    if (index_.serial != camera_.serial) {
      Fault(path_.string() + ": holds camera '" + Shown(index_.serial) + "', not '" +
            Shown(camera_.serial) + "': put the right file in its place");
    }
    if (index_.truncated)
      Fault(path_.string() + ": ends inside a record: run sole take recover");
    else if (index_.skipped_bytes > 0)
      Fault(path_.string() + ": " + std::to_string(index_.skipped_bytes) +
            " bytes belong to no record: run sole take recover");
    std::set<std::int64_t> held;
    std::vector<std::int64_t> unknown;
    for (const RawRecord& record : index_.records) {
      const RawRecordHeader& header = record.header;
      ++result_.records;
      if (header.status != 0) ++result_.incomplete;
      if (header.width != static_cast<std::uint32_t>(camera_.width) ||
          header.height != static_cast<std::uint32_t>(camera_.height))
        Fault(At(record) + "has another image size than " + take_.RigFile().string() + " says");
      if (header.trigger >= 1 && !held.insert(header.trigger).second)
        Fault(At(record) + "is there twice: the first one counts");
      if (header.trigger >= 1 && !triggers_.contains(header.trigger))
        unknown.push_back(header.trigger);
    }
    if (!unknown.empty()) {
      Fault(path_.string() + ": holds triggers that " + take_.Triggers().string() + " lacks (" +
            FormatRanges(unknown) + "): run sole take recover");
    }
    for (const std::int64_t trigger : triggers_) {
      if (!held.contains(trigger)) result_.lost_triggers.push_back(trigger);
    }
  }

  const TakePaths& take_;
  const CameraConfig& camera_;
  std::set<std::int64_t> triggers_;
  fs::path path_;
  RawIndex index_;
  CameraCheck result_;
  const std::atomic<bool>* stopped_ = nullptr;
};

/// Runs `read`; an Error becomes a fault.
template <typename F>
bool Readable(TakeCheck& check, F&& read) {
  try {
    read();
    return true;
  } catch (const Error& error) {
    check.faults.push_back(error.what());
    return false;
  }
}

void CheckVerdict(const TakePaths& take, const TakeInfo& info, TakeCheck& check) {
  const std::string where = take.Info().string();
  if (info.state == "recording")
    check.faults.push_back(where + ": the take was not closed: run sole take recover");
  if (info.state == "complete" && info.verdict.empty())
    check.faults.push_back(where + ": a complete take has no verdict: the file was changed");
  if (info.verdict != "good") return;
  for (const CameraCheck& camera : check.cameras) {
    if (camera.lost_triggers.empty() && camera.incomplete == 0) continue;
    check.faults.push_back(where + ": the verdict is good, but camera " + camera.serial +
                           " lacks " + std::to_string(camera.lost_triggers.size()) +
                           " frames and has " + std::to_string(camera.incomplete) +
                           " incomplete ones");
  }
}

}  // namespace

TakeCheck CheckTake(const fs::path& directory, const TakeCheckOptions& options) {
  const TakePaths take{directory};
  Require(fs::is_directory(directory),
          directory.string() + " is not a take: there is no such folder");
  TakeCheck check;
  TakeInfo info;
  RigConfig config;
  std::vector<TriggerRecord> triggers;
  const bool has_info = Readable(check, [&] { info = ReadTakeInfo(take); });
  const bool has_rig = Readable(check, [&] { config = ReadRigFile(take.RigFile()); });
  if (!has_info && !has_rig)
    throw Error(directory.string() + " is not a take: " + check.faults.front());
  Readable(check, [&] { triggers = ReadTriggers(take); });
  check.triggers = static_cast<std::int64_t>(triggers.size());
  if (has_info && has_rig && info.rig_hash != RigIdentityHash(config)) {
    check.faults.push_back(take.RigFile().string() + ": is not the rig file that " +
                           take.Info().string() + " was recorded with");
  }
  std::vector<CameraChecker> cameras;
  std::int64_t total = 0, done = 0;
  for (const CameraConfig& camera : config.cameras) {
    cameras.emplace_back(take, camera, triggers).Open();
    cameras.back().StopWhen(options.stop);
    total += cameras.back().Records();
  }
  if (options.pixels) {
    std::mutex mutex;
    const auto step = [&] {
      Require(options.stop == nullptr || !options.stop->load(),
              "stopped before everything was checked");
      const std::lock_guard lock(mutex);
      if (options.progress) options.progress(++done, total);
    };
    ForEach(cameras.size(), options.threads, [&](std::size_t i) { cameras[i].CheckPixels(step); });
  }
  for (CameraChecker& camera : cameras) {
    check.faults.insert(check.faults.end(), camera.Result().faults.begin(),
                        camera.Result().faults.end());
    check.cameras.push_back(camera.Result());
  }
  if (has_info) CheckVerdict(take, info, check);
  return check;
}

}  // namespace sole::io
