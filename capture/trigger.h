#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "capture/trigger_log.h"
#include "core/rig_config.h"

namespace sole::capture {

using LogFunction = std::function<void(const std::string&)>;  ///< one line, no newline

/// Makes one edge on the trigger line (and the strobe lines that belong to it) when told.
class Trigger {
 public:
  virtual ~Trigger() = default;
  /// Puts the edge out now. Throws Error if the device refuses.
  virtual void Emit(const TriggerEdge& edge) = 0;
  /// GenICam TriggerSource that cameras must be set to: "Line1" or "Software".
  virtual std::string CameraSource() const { return "Line1"; }
};

/// UDP pulses to 127.0.0.1:bus_port (core/trigger_bus.h): the line of the simulated rig. Throws
/// Error if no socket can be made.
std::unique_ptr<Trigger> MakeSimulatedTrigger(int bus_port);

/// Pulses of `pulse_us` on a GPIO line through libgpiod; all of `lines` are requested as one bulk
/// output and rise together (trigger first, then strobes). `chip` is a name ("gpiochip0") or a
/// path. Throws Error naming chip and line if one does not exist or is in use.
std::unique_ptr<Trigger> MakeGpioTrigger(const std::string& chip, const std::vector<int>& lines,
                                         double pulse_us = 200);

/// Runs every function of `fire` in turn: for cameras without a line, triggered by command one
/// after the other, hence not at the same instant.
std::unique_ptr<Trigger> MakeSoftwareTrigger(std::vector<std::function<void()>> fire);

/// Evenly spaced edges: edge i (from 0) is due at start_ns + i * period_ns and has sequence first +
/// i.
struct TriggerSchedule {
  std::int64_t start_ns = 0;  ///< host time (HostNowNs)
  std::int64_t period_ns = 100'000'000;
  std::int64_t first_sequence = 1;
  std::int64_t count = 0;
  std::vector<ExposureKind> cycle = {ExposureKind::kSpeckle};  ///< repeated
};

/// Fires the schedule from the calling thread by absolute deadlines, so that lateness of one edge
/// does not move the next. An edge that is late keeps four fifths of a period to the one before it,
/// because cameras cannot expose faster. Every edge is appended to `log` just before it goes out.
/// Returns the number fired, fewer than count if `stop` became true.
std::int64_t FireSchedule(Trigger& trigger, const TriggerSchedule& schedule, TriggerLog& log,
                          const std::atomic<bool>* stop = nullptr);

/// While it lives, the calling thread runs with SCHED_FIFO (priority 40) and the process' memory
/// stays resident. What the system refuses is reported through `log` and does without.
class RealtimeScope {
 public:
  explicit RealtimeScope(const LogFunction& log);
  ~RealtimeScope();
  RealtimeScope(const RealtimeScope&) = delete;
  RealtimeScope& operator=(const RealtimeScope&) = delete;

 private:
  bool locked_ = false;
  bool scheduled_ = false;
};

}  // namespace sole::capture
