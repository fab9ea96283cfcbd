#pragma once

#include <cstdint>

namespace sole::capture {

enum class StartOn { kAtOnce, kKey, kFoot };

/// Phases of a take, in order.
enum class TakePhase {
  kWaiting,    ///< triggers fire, the newest frames wait in memory
  kRecording,
  kPostRoll,   ///< the stop has come; the rest is recorded for post_roll
  kDone,
};

const char* ToString(TakePhase phase);

struct TakeControlOptions {
  StartOn start = StartOn::kAtOnce;
  bool stop_on_foot_off = false;
  std::int64_t longest_ns = 0;       ///< recording without post-roll; 0: no limit
  std::int64_t post_roll_ns = 0;
  std::int64_t foot_settle_ns = 300'000'000;  ///< a foot must be seen, or gone, that long
};

/// Decides when a take begins and ends: by key, by a foot on the plate, by time. Counting triggers
/// is the schedule's business.
class TakeControl {
 public:
  explicit TakeControl(const TakeControlOptions& options);

  /// One look; `key` is true once for each hit. Times are host nanoseconds and must not fall.
  TakePhase Update(std::int64_t now_ns, bool key, bool foot);

  TakePhase Phase() const { return phase_; }
  /// When the start condition came true: for a foot, when it was first seen. Valid after kWaiting.
  std::int64_t StartNs() const { return start_ns_; }

 private:
  void Begin(std::int64_t now_ns, std::int64_t since_ns);
  void End(std::int64_t now_ns);

  TakeControlOptions options_;
  TakePhase phase_ = TakePhase::kWaiting;
  bool foot_ = false;
  bool seen_ = false;                ///< a foot was on the plate for long enough since the start
  bool empty_ = false;               ///< the plate was seen without a foot before the start
  std::int64_t foot_since_ns_ = -1;  ///< time of the last change of `foot_`
  std::int64_t start_ns_ = 0;
  std::int64_t begun_ns_ = 0;
  std::int64_t end_ns_ = 0;
};

}  // namespace sole::capture
