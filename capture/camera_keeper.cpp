#include <algorithm>
#include <utility>

#include "capture/camera_keeper_internal.h"
#include "capture/host_clock.h"
#include "core/error.h"

namespace sole::capture {
namespace {

constexpr std::int64_t kMs = 1'000'000;
constexpr std::int64_t kRetryNs = 300 * kMs;
constexpr int kAlarmPeriods = 3;

}  // namespace

CameraKeeper::CameraKeeper(Camera& camera, CameraRecorder& recorder, CameraMonitor& monitor,
                           Options options)
    : camera_(camera),
      recorder_(recorder),
      monitor_(monitor),
      options_(std::move(options)),
      seen_ns_(recorder.LastArrivalNs()) {}

CameraKeeper::~CameraKeeper() { Stop(); }

void CameraKeeper::Stop() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

void CameraKeeper::Look(std::int64_t fired, std::int64_t now_ns) {
  const std::int64_t arrival = recorder_.LastArrivalNs();
  if (arrival != seen_ns_) {
    seen_ns_ = arrival;
    seen_sequence_ = fired;
    if (silent_) {
      silent_ = false;
      gaps_.back().ended = true;
      gaps_.back().reopened = reopened_.exchange(false);
      if (options_.log) {
        options_.log("camera " + camera_.Config().serial + " is back" +
                     (gaps_.back().reopened ? ", all settings applied again" : ""));
      }
    }
    return;
  }
  // Frames come some time after their edge, so silence is counted in edges and in time.
  const auto usual_ns = static_cast<std::int64_t>(2e9 * monitor_.Now().latency_s);
  const std::int64_t late_ns =
      kAlarmPeriods * options_.period_ns + std::clamp(usual_ns, 50 * kMs, 500 * kMs);
  if (!silent_ && fired >= seen_sequence_ + kAlarmPeriods && now_ns - seen_ns_ > late_ns) {
    silent_ = true;
    renewed_ = false;
    gaps_.push_back({.after_trigger = seen_sequence_, .seconds = 0});
    if (options_.log) {
      options_.log("camera " + camera_.Config().serial + " is silent since trigger " +
                   std::to_string(seen_sequence_) + ": check its cable and power");
    }
    if (options_.on_alarm) options_.on_alarm();
  }
  if (!silent_) return;
  gaps_.back().seconds = static_cast<double>(now_ns - seen_ns_) * 1e-9;
  if (working_.load() || stop_.load()) return;
  if (thread_.joinable()) thread_.join();
  working_ = true;
  thread_ = std::thread([this] {
    BringBack();
    working_ = false;
  });
}

bool CameraKeeper::Pause(std::int64_t ns) const { return SleepUntilNs(HostNowNs() + ns, &stop_); }

/// One attempt. Returns when frames may come again or when it is worth another look.
void CameraKeeper::BringBack() {
  switch (camera_.Probe()) {
    case CameraLink::kSilent:
      Pause(kRetryNs);
      return;
    case CameraLink::kOurs: {
      // The link is back and the camera goes on by itself, unless it forgot to stream. Opened anew
      // once and still silent, it wants triggers, and no connection will give it those.
      const std::int64_t before = recorder_.LastArrivalNs();
      const std::int64_t wait_ns = 3 * options_.period_ns + 500 * kMs;
      if (!Pause(wait_ns) || recorder_.LastArrivalNs() != before) return;
      if (renewed_.exchange(true)) return;
      break;
    }
    case CameraLink::kFreed:
      break;
  }
  if (stop_.load()) return;
  try {
    Reopen();
  } catch (const Error& error) {
    Pause(kRetryNs);
  }
}

void CameraKeeper::Reopen() {
  camera_.Reopen();
  camera_.Configure(options_.input);
  recorder_.Retie(camera_.HostMinusDeviceNs());
  monitor_.RestartClock();
  reopened_ = true;
  camera_.Start(options_.buffers);
  Pause(3 * options_.period_ns + 500 * kMs);  // the first frames need that long
}

}  // namespace sole::capture
