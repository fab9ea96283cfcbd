#include "capture/warmup.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

#include "capture/host_clock.h"

namespace sole::capture {
namespace {

constexpr std::int64_t kQuietNs = 300'000'000;     // no camera holds a frame back longer
constexpr std::int64_t kAnswerNs = 1'200'000'000;  // enough for a paced frame on a busy host

struct Inbox {
  int frames = 0;
  int incomplete = 0;
  CameraFrame last;  ///< whole; its pixels are gone
};

/// Counts the frames of all cameras.
class Inboxes {
 public:
  explicit Inboxes(const CameraList& cameras) : cameras_(cameras), inboxes_(cameras.size()) {
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      cameras[i]->SetHandler([this, i](const CameraFrame& frame) { Put(i, frame); });
    }
  }
  ~Inboxes() {
    for (const auto& camera : cameras_) camera->SetHandler({});
  }
  Inboxes(const Inboxes&) = delete;
  Inboxes& operator=(const Inboxes&) = delete;

  void Clear() {
    const std::lock_guard lock(mutex_);
    for (Inbox& inbox : inboxes_) inbox = {};
  }
  std::vector<Inbox> Copy() const {
    const std::lock_guard lock(mutex_);
    return inboxes_;
  }
  /// Waits until every camera has `frames` whole frames, or nothing came for `quiet_ns`.
  void Wait(int frames, std::int64_t quiet_ns) {
    std::unique_lock lock(mutex_);
    last_arrival_ns_ = std::max(last_arrival_ns_, HostNowNs());
    while (std::any_of(inboxes_.begin(), inboxes_.end(),
                       [&](const Inbox& i) { return i.frames < frames; })) {
      const std::int64_t left = last_arrival_ns_ + quiet_ns - HostNowNs();
      if (left <= 0) return;
      arrived_.wait_for(lock, std::chrono::nanoseconds(left));
    }
  }

 private:
  void Put(std::size_t camera, const CameraFrame& frame) {
    const std::lock_guard lock(mutex_);
    Inbox& inbox = inboxes_[camera];
    last_arrival_ns_ = frame.host_time_ns;
    if (frame.complete) {
      ++inbox.frames;
      inbox.last = frame;
      inbox.last.pixels = {};
      inbox.last.hold = {};
    } else {
      ++inbox.incomplete;
    }
    arrived_.notify_all();
  }

  const CameraList& cameras_;
  mutable std::mutex mutex_;
  std::condition_variable arrived_;
  std::vector<Inbox> inboxes_;
  std::int64_t last_arrival_ns_ = 0;
};

}  // namespace

void CloseCameras(CameraList& cameras) {
  std::vector<std::thread> threads;
  for (auto& camera : cameras) threads.emplace_back([&camera] { camera.reset(); });
  for (std::thread& thread : threads) thread.join();
  cameras.clear();
}

std::vector<WarmUpAnswer> WarmUp(const CameraList& cameras, Trigger& trigger,
                                 const WarmUpOptions& options) {
  std::vector<WarmUpAnswer> answers(cameras.size());
  Inboxes inboxes(cameras);
  TriggerLog log;
  std::int64_t sequence = 1 - static_cast<std::int64_t>(options.attempts) * (options.triggers + 1);
  for (int attempt = 0; attempt < options.attempts; ++attempt) {
    inboxes.Clear();
    const TriggerSchedule burst{.start_ns = HostNowNs(),
                                .period_ns = options.period_ns,
                                .first_sequence = sequence,
                                .count = options.triggers};
    if (FireSchedule(trigger, burst, log, options.stop) < options.triggers) return answers;
    inboxes.Wait(options.triggers, std::max(kQuietNs, options.period_ns));
    if (!SleepUntilNs(burst.start_ns + options.triggers * options.period_ns, options.stop))
      return answers;
    const std::vector<Inbox> burst_frames = inboxes.Copy();
    inboxes.Clear();
    sequence += options.triggers;
    FireSchedule(trigger, {.start_ns = HostNowNs(), .first_sequence = sequence, .count = 1}, log);
    const TriggerEdge edge = *log.Find(sequence++);
    inboxes.Wait(1, kAnswerNs);
    SleepUntilNs(edge.actual_ns + options.period_ns, options.stop);
    const std::vector<Inbox> frames = inboxes.Copy();
    bool all = true;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      WarmUpAnswer& answer = answers[i];
      answer.incomplete += burst_frames[i].incomplete + frames[i].incomplete;
      answer.answered = frames[i].frames == 1 && frames[i].incomplete == 0;
      answer.sync = {frames[i].last.frame_id,
                     edge.actual_ns - static_cast<std::int64_t>(frames[i].last.device_time_ns)};
      answer.latency_s = static_cast<double>(frames[i].last.host_time_ns - edge.actual_ns) * 1e-9;
      all = all && answer.answered;
    }
    if (all) break;
  }
  return answers;
}

}  // namespace sole::capture
