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

/// One exposure as the cameras' exposure-active line told it; host nanoseconds.
struct ExposureEcho {
  std::int64_t start_ns = 0;
  std::int64_t end_ns = 0;
};

/// Makes one edge on the trigger line (and the strobe lines that belong to it) when told.
class Trigger {
 public:
  virtual ~Trigger() = default;
  /// Puts the edge out now. Throws Error if the device refuses.
  virtual void Emit(const TriggerEdge& edge) = 0;
  /// GenICam TriggerSource that cameras must be set to: "Line1", "Action1" or "Software".
  virtual std::string CameraSource() const { return "Line1"; }
  /// Whether exposures are read back: then Echoes has one for every edge that cameras obeyed.
  virtual bool ReadsBack() const { return false; }
  /// All so far, in order of time. May be called from any thread.
  virtual std::vector<ExposureEcho> Echoes() const { return {}; }
};

/// UDP pulses to 127.0.0.1:bus_port (core/trigger_bus.h): the line of the simulated rig. Throws
/// Error if no socket can be made.
std::unique_ptr<Trigger> MakeSimulatedTrigger(int bus_port);

/// Lines are numbers ("17") or names, of one chip.
struct GpioTriggerOptions {
  struct Strobe {
    std::string line;
    std::vector<ExposureKind> exposures;
    double pulse_us = 200;
  };
  std::string chip = "gpiochip0";  ///< a name or a path
  std::string line = "17";
  double pulse_us = 200;
  std::vector<Strobe> strobes;
  std::string readback_line;  ///< high while cameras expose; empty: none
};

/// Pulses through libgpiod: trigger line and strobes are requested as one bulk output and rise
/// together. Edges of the read-back line carry the kernel's time stamps. Throws Error naming chip
/// and line if one does not exist or is in use.
std::unique_ptr<Trigger> MakeGpioTrigger(const GpioTriggerOptions& options);

struct ActionTriggerOptions {
  std::string address = "255.255.255.255";  ///< where commands go; a broadcast leaves through every
                                            ///< network interface
  std::uint32_t device_key = 1;
  std::uint32_t group_key = 1;
  std::uint32_t group_mask = 1;
};

/// GigE Vision action commands: one datagram exposes every camera with these keys, within the
/// network's jitter (tens of microseconds on one switch). Throws Error if the address is none or no
/// network interface is up.
std::unique_ptr<Trigger> MakeActionTrigger(const ActionTriggerOptions& options);

/// Runs every function of `fire` in turn: for cameras without a line, triggered by command one
/// after the other, hence not at the same instant.
std::unique_ptr<Trigger> MakeSoftwareTrigger(std::vector<std::function<void()>> fire);

/// Edge i (from 0) has sequence first + i. The cycle of kinds is repeated; it lasts as many
/// periods as it has kinds. Its edges are spread evenly, or gap_ns apart if that is not 0.
struct TriggerSchedule {
  std::int64_t start_ns = 0;  ///< host time (HostNowNs)
  std::int64_t period_ns = 100'000'000;
  std::int64_t gap_ns = 0;
  std::int64_t first_sequence = 1;
  std::int64_t count = 0;
  std::vector<ExposureKind> cycle = {ExposureKind::kSpeckle};
};

/// Fires the schedule from the calling thread by absolute deadlines, so that lateness of one edge
/// does not move the next. An edge that is late keeps four fifths of a period to the one before it,
/// because cameras cannot expose faster. Every edge is appended to `log` just before it goes out.
/// Returns the number fired, fewer than count if `stop` became true or `last`, which may be set
/// meanwhile, is the sequence of the edge before.
std::int64_t FireSchedule(Trigger& trigger, const TriggerSchedule& schedule, TriggerLog& log,
                          const std::atomic<bool>* stop = nullptr,
                          const std::atomic<std::int64_t>* last = nullptr);

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
