#include "capture/recorder.h"

#include <algorithm>
#include <ctime>
#include <limits>
#include <mutex>
#include <thread>
#include <utility>

#include "capture/camera_keeper_internal.h"
#include "capture/camera_recorder_internal.h"
#include "capture/desync.h"
#include "capture/disk_check.h"
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
constexpr std::int64_t kFilesEveryNs = 1'000 * kMs;
constexpr std::int64_t kProgressEveryNs = 100 * kMs;
constexpr std::int64_t kPicturesEveryNs = 500 * kMs;
constexpr std::int64_t kNoLimit = 100'000'000;

std::string UtcNow() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  gmtime_r(&now, &parts);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text;
}

std::int64_t Ns(double seconds) { return static_cast<std::int64_t>(1e9 * seconds); }

/// Calls its function every so often.
class Every {
 public:
  explicit Every(std::int64_t interval_ns) : interval_ns_(interval_ns) {}
  bool Due(std::int64_t now_ns) {
    if (now_ns < next_ns_) return false;
    next_ns_ = now_ns + interval_ns_;
    return true;
  }

 private:
  std::int64_t interval_ns_;
  std::int64_t next_ns_ = 0;
};

/// Everything of one take between the opened cameras and the closed files. Sequences count edges on
/// the trigger line from 1; the take's triggers count from 1 too, from first_ on.
class Session {
 public:
  Session(const RigConfig& config, const RecordOptions& options)
      : config_(config),
        options_(options),
        folder_(options.directory, config, BytesPlanned()),
        period_ns_(PeriodNs(config.trigger)),
        control_({.start = options.start,
                  .stop_on_foot_off = options.stop_on_foot_off,
                  .longest_ns = Ns(options.seconds),
                  .post_roll_ns = Ns(config.trigger.post_roll_s)}) {
    if (options.start != StartOn::kAtOnce) {
      hold_frames_ =
          1 + static_cast<int>(Ns(config.trigger.pre_roll_s + kSettleS) / period_ns_);
    }
  }
  ~Session() {
    keepers_.clear();
    recorders_.clear();
    trigger_.reset();
    CloseCameras(cameras_);
  }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  RecordResult Run() {
    OpenCameras();
    answers_ = WarmUpCameras();
    WriteHead();
    StartRecorders();
    Fire();
    Require(first_ > 0, "stopped before the first trigger: nothing was recorded");
    return Close();
  }

 private:
  static constexpr double kSettleS = 0.5;  ///< a foot's start is known that much later

  void Log(const std::string& line) const {
    if (options_.log) options_.log(line);
  }
  void Tell(RecordEvent event) const {
    if (options_.on_event) options_.on_event(event);
  }
  bool StopAsked() const { return options_.stop != nullptr && options_.stop->load(); }

  double BytesPlanned() const {
    if (options_.discard) return 0;
    const double rate = config_.trigger.rate_hz * static_cast<double>(config_.trigger.exposures.size());
    double triggers = options_.triggers > 0 ? static_cast<double>(options_.triggers) : 10 * rate;
    if (options_.seconds > 0) triggers = std::min(triggers, options_.seconds * rate + 1);
    triggers += (config_.trigger.pre_roll_s + config_.trigger.post_roll_s) * rate;
    return BytesNeeded(config_, static_cast<std::int64_t>(triggers));
  }

  void OpenCameras() {
    const TriggerInput input = InputFor(config_.trigger);
    for (const CameraConfig& camera : config_.cameras)
      cameras_.push_back(std::make_unique<Camera>(camera));
    for (const auto& camera : cameras_) camera->Configure(input);
    trigger_ = MakeTrigger(config_, cameras_);
    for (const auto& camera : cameras_) camera->Start(Buffers());
  }
  int Buffers() const { return options_.queue_frames + hold_frames_ + kStreamBuffers; }

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
    info_.consent = options_.consent;
    info_.notes = options_.notes;
    info_.created = UtcNow();
    info_.software = options_.software;
    info_.rig_hash = RigIdentityHash(config_);
    info_.state = "recording";
    io::WriteRigFile(folder_.Paths().RigFile(), config_);
    io::WriteTriggers(folder_.Paths(), {});
    io::WriteTakeInfo(folder_.Paths(), info_);
  }

  void StartRecorders() {
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      resent_before_.push_back(cameras_[i]->Statistics().resent_packets);  // the warm-up's
      CameraMonitor& monitor = *monitors_.emplace_back(std::make_unique<CameraMonitor>());
      if (options_.pictures) monitor.KeepPictures(static_cast<double>(kPicturesEveryNs) * 1e-9);
      recorders_.push_back(std::make_unique<CameraRecorder>(
          *cameras_[i], answers_[i].sync, log_,
          CameraRecorder::Options{
              .path = folder_.Paths().Raw(config_.cameras[i].serial),
              .queue_frames = options_.queue_frames,
              .hold_frames = hold_frames_,
              .period_ns = period_ns_,
              .discard = options_.discard,
              .on_failure = [this](const std::string& message) { Fail(message); },
              .on_frame = [&monitor](const CameraFrame& frame,
                                     const FrameMatch& match) { monitor.OnFrame(frame, match); },
              .on_stored = StoredFrames(config_.cameras[i].serial)}));
      keepers_.push_back(std::make_unique<CameraKeeper>(
          *cameras_[i], *recorders_[i], monitor,
          CameraKeeper::Options{.input = InputFor(config_.trigger),
                                .period_ns = period_ns_,
                                .buffers = Buffers(),
                                .log = options_.log,
                                .on_alarm = [this] { Tell(RecordEvent::kFault); }}));
    }
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
    Tell(RecordEvent::kFault);
  }

  void Fire() {
    std::atomic<bool> fired{false};
    const bool waits = options_.start != StartOn::kAtOnce;
    const std::int64_t planned = options_.triggers > 0 ? options_.triggers : kNoLimit;
    const TriggerSchedule schedule = ScheduleFor(config_.trigger, HostNowNs() + period_ns_,
                                                 waits ? kNoLimit : planned);
    if (!waits) {
      control_.Update(schedule.start_ns, false, false);
      Begin();
    }
    std::thread thread([&] {
      try {
        const RealtimeScope realtime(options_.log);
        FireSchedule(*trigger_, schedule, log_, &halt_, &last_);
      } catch (const std::exception& error) {
        Fail(error.what());
      }
      fired = true;
    });
    try {
      while (!fired.load()) Watch();
      if (first_ > 0) Tell(RecordEvent::kStop);
      const std::int64_t end = HostNowNs() + 10 * kTailQuietNs;
      while (!AllArrived() && HostNowNs() < std::min(end, LastEventNs() + kTailQuietNs)) Watch();
    } catch (const std::exception& error) {
      Fail(error.what());
    }
    thread.join();
  }

  /// The take begins: frames held from the pre-roll on are the first.
  void Begin() {
    first_ = 1;
    if (hold_frames_ > 0) {
      const std::int64_t from_ns = control_.StartNs() - Ns(config_.trigger.pre_roll_s);
      const std::vector<TriggerEdge> edges = log_.Edges();
      const auto held = edges.size() > static_cast<std::size_t>(hold_frames_)
                            ? edges.end() - hold_frames_
                            : edges.begin();
      const auto first = std::find_if(held, edges.end(), [&](const TriggerEdge& edge) {
        return edge.actual_ns >= from_ns;
      });
      const auto start = std::find_if(first, edges.end(), [&](const TriggerEdge& edge) {
        return edge.actual_ns >= control_.StartNs();
      });
      const std::int64_t next = edges.empty() ? 1 : edges.back().sequence + 1;
      first_ = first == edges.end() ? next : first->sequence;
      const std::int64_t start_sequence = start == edges.end() ? next : start->sequence;
      if (options_.triggers > 0) last_ = start_sequence + options_.triggers - 1;
      for (const auto& recorder : recorders_) recorder->Release(first_);
      for (const auto& monitor : monitors_) monitor->Restart();
    }
    folder_.Keep();
    Tell(RecordEvent::kStart);
  }

  /// One look at start and stop, alarms, progress and what is written meanwhile.
  void Watch() {
    SleepUntilNs(HostNowNs() + 10 * kMs);
    if (StopAsked()) halt_ = true;
    const std::int64_t now = HostNowNs();
    if (!halt_.load()) Control(now);
    const std::int64_t fired = log_.Size();
    for (const auto& keeper : keepers_) keeper->Look(fired, now);
    if (options_.progress && progress_.Due(now)) options_.progress(Status());
    if (options_.pictures && pictures_.Due(now)) ShowPictures();
    if (files_.Due(now) && first_ > 0) {
      WriteTriggersFile();
      if (!options_.discard && !full_ && RoomLeft(options_.directory, config_.disk) < 0) {
        full_ = true;  // what is written stays whole: an end, not an accident
        Log("the disk is full but for its reserve: the take ends here");
        halt_ = true;
      }
    }
  }

  void Control(std::int64_t now) {
    const bool key = options_.key && options_.key();
    const TakePhase before = control_.Phase();
    const TakePhase phase = control_.Update(now, key, FootOnPlate());
    if (before == TakePhase::kWaiting && phase != TakePhase::kWaiting) Begin();
    if (phase == TakePhase::kDone) {
      ended_ = true;
      halt_ = true;
    }
  }

  /// Cameras below the plate see it; any camera where none is below.
  bool FootOnPlate() const {
    bool below = false, seen_below = false, seen = false;
    for (std::size_t i = 0; i < monitors_.size(); ++i) {
      const bool foot = monitors_[i]->Now().foot;
      const bool is_below = config_.cameras[i].position_m.z() < 0;
      below = below || is_below;
      seen_below = seen_below || (is_below && foot);
      seen = seen || foot;
    }
    return below ? seen_below : seen;
  }

  std::int64_t TakeTriggers() const { return first_ > 0 ? log_.Size() - first_ + 1 : 0; }

  RecordProgress Status() const {
    RecordProgress status;
    status.phase = finished_ ? TakePhase::kDone : control_.Phase();
    status.fired = TakeTriggers();
    status.triggers = options_.triggers;
    const auto edges = log_.Edges();
    for (std::size_t i = edges.size() > 50 ? edges.size() - 50 : 0; i < edges.size(); ++i) {
      const double late_s = static_cast<double>(edges[i].actual_ns - edges[i].scheduled_ns) * 1e-9;
      status.trigger_jitter_s = std::max(status.trigger_jitter_s, late_s);
    }
    if (!options_.discard) {
      status.disk_left_s =
          RoomLeft(options_.directory, config_.disk) / WriteRateNeeded(config_);
    }
    for (std::size_t i = 0; i < cameras_.size(); ++i) {
      const CameraMonitor::Snapshot now = monitors_[i]->Now();
      CameraStatus camera;
      camera.serial = config_.cameras[i].serial;
      camera.frames = first_ > 0 ? recorders_[i]->Arrived() : 0;
      // The newest trigger's frame is on its way.
      camera.lost = std::max<std::int64_t>(0, status.fired - (finished_ ? 0 : 1) - camera.frames);
      camera.resent_packets = cameras_[i]->Statistics().resent_packets - resent_before_[i];
      camera.saturated = now.sample.saturated;
      camera.focus = now.sample.focus;
      camera.queued = recorders_[i]->Queued();
      camera.latency_s = now.latency_s;
      camera.sync_s = now.residual_s;
      camera.silent = keepers_[i]->Silent();
      camera.reconnecting = keepers_[i]->Reconnecting();
      camera.foot = now.foot;
      status.frames += recorders_[i]->Stored();
      status.cameras.push_back(camera);
    }
    return status;
  }

  void ShowPictures() const {
    std::vector<ImageU8> pictures;
    for (const auto& monitor : monitors_) pictures.push_back(monitor->Picture());
    options_.pictures(pictures);
  }

  bool AllArrived() const {
    return std::all_of(recorders_.begin(), recorders_.end(), [&](const auto& recorder) {
      return recorder->Arrived() >= TakeTriggers();
    });
  }
  std::int64_t LastEventNs() const {
    const auto edges = log_.Edges();
    std::int64_t last = edges.empty() ? 0 : edges.back().actual_ns;
    for (const auto& recorder : recorders_) last = std::max(last, recorder->LastArrivalNs());
    return last;
  }

  std::vector<TriggerEdge> TakeEdges() const {
    std::vector<TriggerEdge> edges = log_.Edges();
    edges.erase(edges.begin(), edges.begin() + (first_ - 1));
    return edges;
  }

  std::vector<io::TriggerRecord> Records() const {
    double exposure_us = 0;
    for (const CameraConfig& camera : config_.cameras)
      exposure_us = std::max(exposure_us, camera.exposure_us);
    if (!trigger_->ReadsBack()) return TriggerRecords(TakeEdges(), exposure_us * 1e-6);
    const std::vector<ExposureEcho> echoes = trigger_->Echoes();
    return TriggerRecords(TakeEdges(), exposure_us * 1e-6, &echoes);
  }
  void WriteTriggersFile() { io::WriteTriggers(folder_.Paths(), Records()); }

  RecordResult Close() {
    for (const auto& keeper : keepers_) keeper->Stop();
    for (const auto& recorder : recorders_) Guarded([&] { recorder->Finish(); });
    finished_ = true;
    if (options_.progress) options_.progress(Status());
    Guarded([&] { WriteTriggersFile(); });
    RecordResult result;
    result.triggers = TakeTriggers();
    AddTriggerTimes(result);
    AddCameras(result);
    std::vector<TakeFinding> findings = ImageFindings(result);
    result.state = failures_.empty() ? "complete" : "aborted";
    result.reasons = failures_;
    if (full_) findings.push_back({"the disk was full: the take ends early", false});
    result.stopped = failures_.empty() && !ended_ && !full_ && options_.triggers > 0 &&
                     result.triggers < options_.triggers;
    Judge(result, options_.triggers, options_.usable_loss,
          static_cast<double>(period_ns_) * 1e-9, findings);
    info_.state = result.state;
    info_.verdict = result.verdict;
    info_.reasons = result.reasons;
    io::WriteTakeInfo(folder_.Paths(), info_);
    if (result.verdict == "repeat") Tell(RecordEvent::kFault);
    return result;
  }

  void AddTriggerTimes(RecordResult& result) const {
    for (const TriggerEdge& edge : TakeEdges()) {
      const double late_s = static_cast<double>(edge.actual_ns - edge.scheduled_ns) * 1e-9;
      result.trigger_late_max_s = std::max(result.trigger_late_max_s, late_s);
    }
    if (!trigger_->ReadsBack()) return;
    for (const io::TriggerRecord& record : Records()) {
      if (!(record.exposure_end_s > record.exposure_start_s)) result.unexposed.push_back(record.trigger);
    }
  }

  void AddCameras(RecordResult& result) const {
    std::vector<std::map<std::int64_t, double>> motion;
    for (const auto& monitor : monitors_) motion.push_back(monitor->Motion());
    const std::vector<int> shifts = ImageShifts(motion);
    for (std::size_t i = 0; i < recorders_.size(); ++i) {
      CameraRecord record = recorders_[i]->Result(result.triggers);
      record.latency_median_s = monitors_[i]->MedianLatencyS();
      record.latency_warmup_s = answers_[i].latency_s;
      record.clock = monitors_[i]->Clock();
      record.shift = shifts[i];
      const CameraConfig& camera = config_.cameras[i];
      constexpr int kPacketOverhead = 36;  // IP, UDP and GVSP headers
      const double packets =
          1.0 * camera.width * camera.height / (camera.packet_size - kPacketOverhead) + 2;
      if (record.expected > 0) {
        record.resent_share = static_cast<double>(record.resent_packets) /
                              (packets * static_cast<double>(record.expected));
      }
      for (CameraGap gap : keepers_[i]->Gaps()) {
        gap.after_trigger = std::max<std::int64_t>(0, gap.after_trigger - first_ + 1);
        record.gaps.push_back(gap);
      }
      result.cameras.push_back(std::move(record));
    }
  }

  std::vector<TakeFinding> ImageFindings(const RecordResult& result) {
    std::vector<TakeFinding> findings;
    if (options_.discard || result.triggers == 0) return findings;
    const auto add = [&](std::vector<TakeFinding> more) {
      findings.insert(findings.end(), more.begin(), more.end());
    };
    if (options_.check_images) {
      Guarded([&] { add(CheckTakeImages(options_.directory, config_, options_.reference)); });
    }
    if (options_.check) Guarded([&] { add(options_.check(options_.directory)); });
    return findings;
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
  int hold_frames_ = 0;
  TakeControl control_;
  io::TakeInfo info_;
  TriggerLog log_;
  std::atomic<bool> halt_{false};
  std::atomic<std::int64_t> last_{std::numeric_limits<std::int64_t>::max()};
  std::int64_t first_ = 0;  ///< sequence of the take's first trigger; 0 while it waits
  bool ended_ = false;      ///< by key, foot or time: as the operator wanted
  bool full_ = false;
  bool finished_ = false;   ///< the files are closed
  std::mutex failure_mutex_;
  std::vector<std::string> failures_;
  CameraList cameras_;
  std::unique_ptr<Trigger> trigger_;
  std::vector<WarmUpAnswer> answers_;
  std::vector<std::uint64_t> resent_before_;
  std::vector<std::unique_ptr<CameraMonitor>> monitors_;
  std::vector<std::unique_ptr<CameraRecorder>> recorders_;
  std::vector<std::unique_ptr<CameraKeeper>> keepers_;
  Every progress_{kProgressEveryNs}, pictures_{kPicturesEveryNs}, files_{kFilesEveryNs};
};

}  // namespace

RecordResult Record(const RigConfig& config, const RecordOptions& options) {
  RigConfig used = config;
  if (!options.cycle.empty()) {
    used.trigger.exposures = options.cycle;
    used.trigger.exposure_gap_s = 0;
  }
  Validate(used);
  io::ParseRig(io::FormatRig(used),
               "rig '" + config.name + "'");  // the take's own rig file must be readable
  Require(options.triggers >= 0 && options.triggers <= kNoLimit && options.seconds >= 0,
          "triggers " + std::to_string(options.triggers) + ": record 1 to 100000000");
  Require(options.triggers > 0 || options.seconds > 0 || options.stop_on_foot_off || options.key ||
              options.stop != nullptr,
          "a take without an end: give a number of triggers, a time, or a way to stop it");
  Require(!options.directory.empty(), "a take needs a directory");
  Require(options.queue_frames > 0 && options.warmup_attempts > 0,
          "queue_frames and warmup_attempts must be 1 or more");
  if (!options.reference.empty()) RequireReference(options.reference, used);
  return Session(used, options).Run();
}

}  // namespace sole::capture
