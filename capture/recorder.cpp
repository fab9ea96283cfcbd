#include "capture/recorder.h"

#include <algorithm>
#include <ctime>
#include <mutex>
#include <thread>
#include <utility>

#include "capture/camera_recorder_internal.h"
#include "capture/host_clock.h"
#include "capture/rig_session_internal.h"
#include "capture/take_folder_internal.h"
#include "core/error.h"
#include "io/rig_file.h"

namespace sole::capture {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr int kStreamBuffers = 16;  // beyond those that wait for the disk
constexpr std::int64_t kTailQuietNs = 1'500 * kMs;  // longer than any resend
constexpr std::int64_t kTriggersFileEveryNs = 1'000 * kMs;
constexpr std::int64_t kProgressEveryNs = 100 * kMs;

std::string UtcNow() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

/// Everything of one take between the opened cameras and the closed files.
class Session {
 public:
  Session(const RigConfig& config, const RecordOptions& options)
      : config_(config),
        options_(options),
        folder_(options.directory, options.discard ? 0 : BytesNeeded(config, options.triggers)),
        period_ns_(PeriodNs(config.trigger)) {}
  ~Session() {
    recorders_.clear();
    trigger_.reset();
    CloseCameras(cameras_);
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  RecordResult Run() {
    OpenCameras();
    const std::vector<WarmUpAnswer> answers = WarmUpCameras();
    WriteHead();
    StartRecorders(answers);
    folder_.Keep();
    Fire();
    return Close();
  }

 private:
  void Log(const std::string& line) const {
    if (options_.log) options_.log(line);
  }
  bool StopAsked() const { return options_.stop != nullptr && options_.stop->load(); }

  void OpenCameras() {
    const TriggerInput input = InputFor(config_.trigger);
    for (const CameraConfig& camera : config_.cameras)
      cameras_.push_back(std::make_unique<Camera>(camera));
    for (const auto& camera : cameras_) camera->Configure(input);
    trigger_ = MakeTrigger(config_, cameras_);
    for (const auto& camera : cameras_) camera->Start(options_.queue_frames + kStreamBuffers);
  }

  std::vector<WarmUpAnswer> WarmUpCameras() {
    std::vector<WarmUpAnswer> answers = WarmUp(cameras_, *trigger_,
                                               {.triggers = config_.trigger.warmup,
                                                .attempts = options_.warmup_attempts,
                                                .period_ns = period_ns_,
                                                .stop = options_.stop});
    Require(!StopAsked(), "stopped before the first trigger: nothing was recorded");
    for (std::size_t i = 0; i < answers.size(); ++i) {
      Require(answers[i].answered,
              "camera " + config_.cameras[i].serial +
                  " does not answer the trigger: " + DescribeSilence(answers[i], config_.trigger));
    }
    return answers;
  }

  void WriteHead() {
    info_.name = options_.name.empty() ? options_.directory.filename().string() : options_.name;
    info_.subject = options_.subject;
    info_.notes = options_.notes;
    info_.created = UtcNow();
    info_.software = options_.software;
    info_.rig_hash = RigIdentityHash(config_);
    info_.state = "recording";
    io::WriteRigFile(folder_.Paths().RigFile(), config_);
    io::WriteTriggers(folder_.Paths(), {});
    io::WriteTakeInfo(folder_.Paths(), info_);
  }

  void StartRecorders(const std::vector<WarmUpAnswer>& answers) {
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      recorders_.push_back(std::make_unique<CameraRecorder>(
          *cameras_[i], answers[i].sync, log_,
          CameraRecorder::Options{
              .path = folder_.Paths().Raw(config_.cameras[i].serial),
              .queue_frames = options_.queue_frames,
              .period_ns = period_ns_,
              .discard = options_.discard,
              .on_failure = [this](const std::string& message) { Fail(message); },
              .on_stored = StoredFrames(config_.cameras[i].serial)}));
    }
    silent_.assign(cameras_.size(), false);
  }

  std::function<void(const io::RawRecordHeader&, std::uint32_t)> StoredFrames(
      const std::string& serial) const {
    if (!options_.on_stored) return {};
    return [this, serial](const io::RawRecordHeader& header, std::uint32_t crc) {
      options_.on_stored(serial, header, crc);
    };
  }

  void Fail(const std::string& message) {
    {
      const std::lock_guard lock(failure_mutex_);
      if (failures_.empty()) Log(message);
      failures_.push_back(message);
    }
    halt_ = true;
  }

  void Fire() {
    std::atomic<bool> fired{false};
    std::thread thread([&] {
      try {
        const RealtimeScope realtime(options_.log);
        const TriggerSchedule schedule{.start_ns = HostNowNs() + period_ns_,
                                       .period_ns = period_ns_,
                                       .first_sequence = 1,
                                       .count = options_.triggers,
                                       .cycle = options_.cycle};
        FireSchedule(*trigger_, schedule, log_, &halt_);
      } catch (const std::exception& error) {
        Fail(error.what());
      }
      fired = true;
    });
    try {
      while (!fired.load()) Watch();
      const std::int64_t end = HostNowNs() + 10 * kTailQuietNs;
      while (!AllArrived() && HostNowNs() < std::min(end, LastEventNs() + kTailQuietNs)) Watch();
    } catch (const std::exception& error) {
      Fail(error.what());
    }
    thread.join();
  }

  /// One look at stop, alarms, progress and the trigger file.
  void Watch() {
    SleepUntilNs(HostNowNs() + 10 * kMs);
    if (StopAsked()) halt_ = true;
    WatchSilence();
    const std::int64_t now = HostNowNs();
    if (options_.progress && now >= next_progress_ns_) {
      next_progress_ns_ = now + kProgressEveryNs;
      std::int64_t frames = 0;
      for (const auto& recorder : recorders_) frames += recorder->Stored();
      options_.progress({log_.Size(), options_.triggers, frames});
    }
    if (now >= next_triggers_ns_) {
      next_triggers_ns_ = now + kTriggersFileEveryNs;
      WriteTriggersFile();
    }
  }

  /// Aravis tells a lost camera only after seconds; three missed triggers are an alarm.
  void WatchSilence() {
    const std::int64_t fired = log_.Size();
    if (fired < 4) return;
    const std::int64_t late_ns = std::max(3 * period_ns_, 500 * kMs);
    for (std::size_t i = 0; i < recorders_.size(); ++i) {
      const bool silent = HostNowNs() - recorders_[i]->LastArrivalNs() > late_ns &&
                          recorders_[i]->Arrived() + 3 <= fired;
      if (silent != silent_[i] && silent) {
        Log("camera " + config_.cameras[i].serial + " is silent since trigger " +
            std::to_string(recorders_[i]->Arrived()) + ": check its cable and power");
      }
      silent_[i] = silent;
    }
  }

  bool AllArrived() const {
    return std::all_of(recorders_.begin(), recorders_.end(),
                       [&](const auto& recorder) { return recorder->Arrived() >= log_.Size(); });
  }
  std::int64_t LastEventNs() const {
    const auto edges = log_.Edges();
    std::int64_t last = edges.empty() ? 0 : edges.back().actual_ns;
    for (const auto& recorder : recorders_) last = std::max(last, recorder->LastArrivalNs());
    return last;
  }

  void WriteTriggersFile() {
    double exposure_us = 0;
    for (const CameraConfig& camera : config_.cameras)
      exposure_us = std::max(exposure_us, camera.exposure_us);
    io::WriteTriggers(folder_.Paths(), TriggerRecords(log_.Edges(), exposure_us * 1e-6));
  }

  RecordResult Close() {
    for (const auto& recorder : recorders_) Guarded([&] { recorder->Finish(); });
    Guarded([&] { WriteTriggersFile(); });
    RecordResult result;
    result.triggers = log_.Size();
    result.state = failures_.empty() ? "complete" : "aborted";
    result.reasons = failures_;
    result.stopped = failures_.empty() && result.triggers < options_.triggers;
    for (const TriggerEdge& edge : log_.Edges()) {
      const double late_s = static_cast<double>(edge.actual_ns - edge.scheduled_ns) * 1e-9;
      result.trigger_late_max_s = std::max(result.trigger_late_max_s, late_s);
    }
    for (const auto& recorder : recorders_)
      result.cameras.push_back(recorder->Result(result.triggers));
    Judge(result, options_.triggers, options_.usable_loss);
    info_.state = result.state;
    info_.verdict = result.verdict;
    info_.reasons = result.reasons;
    io::WriteTakeInfo(folder_.Paths(), info_);
    return result;
  }

  /// Lets closing go on with the next step when one fails.
  template <typename F>
  void Guarded(F&& step) {
    try {
      step();
    } catch (const std::exception& error) {
      Fail(error.what());
    }
  }

  const RigConfig& config_;
  const RecordOptions& options_;
  TakeFolder folder_;
  std::int64_t period_ns_;
  io::TakeInfo info_;
  TriggerLog log_;
  std::atomic<bool> halt_{false};
  std::mutex failure_mutex_;
  std::vector<std::string> failures_;
  CameraList cameras_;
  std::unique_ptr<Trigger> trigger_;
  std::vector<std::unique_ptr<CameraRecorder>> recorders_;
  std::vector<bool> silent_;
  std::int64_t next_progress_ns_ = 0;
  std::int64_t next_triggers_ns_ = 0;
};

}  // namespace

RecordResult Record(const RigConfig& config, const RecordOptions& options) {
  Validate(config);
  io::ParseRig(io::FormatRig(config),
               "rig '" + config.name + "'");  // the take's own rig file must be readable
  Require(options.triggers > 0 && options.triggers <= 100'000'000,
          "triggers " + std::to_string(options.triggers) + ": record 1 to 100000000");
  Require(!options.directory.empty(), "a take needs a directory");
  Require(options.queue_frames > 0 && options.warmup_attempts > 0 && !options.cycle.empty(),
          "queue_frames, warmup_attempts and cycle must not be empty or below 1");
  return Session(config, options).Run();
}

}  // namespace sole::capture
