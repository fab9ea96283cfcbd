#include <map>

#include "core/error.h"
#include "io/raw_file.h"
#include "io/rig_file.h"
#include "io/shown_internal.h"
#include "io/take.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

/// One camera's file and its good records by trigger.
struct CameraFile {
  fs::path path;
  std::map<std::int64_t, RawRecord> records;
};

/// Incomplete frames are left out: their image counts as absent.
CameraFile OpenCamera(const TakePaths& take, const CameraConfig& camera) {
  CameraFile file{take.Raw(camera.serial), {}};
  const fs::path partial = file.path.string() + ".partial";
  if (!fs::exists(file.path) && fs::exists(partial)) file.path = partial;
  Require(fs::exists(file.path) || !fs::exists(take.Archive(camera.serial)),
          "take " + take.root.string() + " is archived: run sole take archive --restore " +
              take.root.string() + " first");
  Require(fs::exists(file.path),
          "take " + take.root.string() + ": camera '" + Shown(camera.serial) +
              "' of its rig file has no recording: " + file.path.string() + " is missing");
  const RawIndex index = ReadRawIndex(file.path);
  Require(index.serial == camera.serial, file.path.string() + ": holds camera '" +
                                             Shown(index.serial) + "', not '" +
                                             Shown(camera.serial) + "'");
  for (const RawRecord& record : index.records) {
    const RawRecordHeader& header = record.header;
    Require(header.width == static_cast<std::uint32_t>(camera.width) &&
                header.height == static_cast<std::uint32_t>(camera.height),
            file.path.string() + ": images of " + std::to_string(header.width) + " x " +
                std::to_string(header.height) + " pixels, but " + take.RigFile().string() +
                " says " + std::to_string(camera.width) + " x " + std::to_string(camera.height));
    if (header.status == 0 && header.trigger >= 1) file.records.emplace(header.trigger, record);
  }
  return file;
}

}  // namespace

struct TakeReader::State {
  TakePaths paths;
  TakeInfo info;
  RigConfig config;
  std::vector<TriggerRecord> triggers;
  std::vector<CameraFile> cameras;
  std::size_t next = 0;
  std::function<void(const std::string&)> warn;

  std::optional<ImageU8> Image(const CameraFile& camera, std::int64_t trigger) const {
    const auto record = camera.records.find(trigger);
    if (record == camera.records.end()) return {};
    try {
      return ReadRawImage(camera.path, record->second);
    } catch (const DamagedRecordError& error) {
      if (warn) warn(std::string("warning: ") + error.what() + "; the image counts as absent");
      return {};
    }
  }
};

TakeReader::TakeReader(const fs::path& directory, std::function<void(const std::string&)> warn)
    : state_(std::make_unique<State>()) {
  State& state = *state_;
  state.warn = std::move(warn);
  state.paths.root = directory;
  Require(fs::is_directory(directory),
          directory.string() + " is not a take: there is no such folder");
  state.info = ReadTakeInfo(state.paths);
  state.config = ReadRigFile(state.paths.RigFile());
  state.triggers = ReadTriggers(state.paths);
  for (const CameraConfig& camera : state.config.cameras) {
    state.cameras.push_back(OpenCamera(state.paths, camera));
  }
}

TakeReader::~TakeReader() = default;

const TakeInfo& TakeReader::Info() const { return state_->info; }
const RigConfig& TakeReader::Config() const { return state_->config; }
const std::vector<TriggerRecord>& TakeReader::Triggers() const { return state_->triggers; }

std::optional<FrameSet> TakeReader::Next() {
  if (state_->next >= state_->triggers.size()) return {};
  return Read(state_->next++);
}

FrameSet TakeReader::Read(std::size_t index) const {
  Require(index < state_->triggers.size(), "take " + state_->paths.root.string() + ": has " +
                                               std::to_string(state_->triggers.size()) +
                                               " triggers, asked for number " +
                                               std::to_string(index + 1));
  const TriggerRecord& trigger = state_->triggers[index];
  FrameSet frames{trigger.trigger, trigger.actual_s, trigger.kind, {}};
  for (const CameraFile& camera : state_->cameras)
    frames.images.push_back(state_->Image(camera, trigger.trigger));
  return frames;
}

}  // namespace sole::io
