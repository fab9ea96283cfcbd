#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "capture/camera.h"
#include "capture/camera_monitor.h"
#include "capture/camera_recorder_internal.h"
#include "capture/recorder.h"
#include "capture/trigger.h"

namespace sole::capture {

/// Watches one camera during a take: raises the alarm after three missed triggers and brings the
/// camera back on a thread of its own, with all settings applied and read back, while the others
/// go on. Look belongs to one thread.
class CameraKeeper {
 public:
  struct Options {
    TriggerInput input;
    std::int64_t period_ns = 0;
    int buffers = 24;  ///< of the stream when it is opened anew
    LogFunction log;
    std::function<void()> on_alarm;
  };
  CameraKeeper(Camera& camera, CameraRecorder& recorder, CameraMonitor& monitor, Options options);
  ~CameraKeeper();
  CameraKeeper(const CameraKeeper&) = delete;
  CameraKeeper& operator=(const CameraKeeper&) = delete;

  /// `fired`: the sequence of the newest edge, `now_ns` host time.
  void Look(std::int64_t fired, std::int64_t now_ns);
  bool Silent() const { return silent_; }
  bool Reconnecting() const { return working_.load(); }
  /// Ends the attempts to reconnect; may wait seconds for one that is under way. Gaps are final.
  void Stop();
  /// Sequences of the bus, not numbers of the take.
  const std::vector<CameraGap>& Gaps() const { return gaps_; }

 private:
  void BringBack();
  void Reopen();
  bool Pause(std::int64_t ns) const;

  Camera& camera_;
  CameraRecorder& recorder_;
  CameraMonitor& monitor_;
  Options options_;
  std::int64_t seen_ns_ = 0;        ///< last arrival that Look saw
  std::int64_t seen_sequence_ = 0;  ///< newest edge at that time
  bool silent_ = false;
  std::atomic<bool> renewed_{false};  ///< a camera that was ours was opened anew in this gap
  std::vector<CameraGap> gaps_;
  std::atomic<bool> stop_{false};
  std::atomic<bool> working_{false};
  std::atomic<bool> reopened_{false};
  std::thread thread_;
};

}  // namespace sole::capture
