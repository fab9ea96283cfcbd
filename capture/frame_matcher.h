#pragma once

#include <cstdint>
#include <optional>
#include <set>

#include "capture/trigger_log.h"

namespace sole::capture {

/// What is known of a camera after warm-up: the frame that answered a known edge.
struct CameraSync {
  std::int64_t frame_id = 0;  ///< unwrapped id of the frame that answered the last warm-up edge
  std::int64_t host_minus_device_ns = 0;  ///< edge's host time minus that frame's camera timestamp
};

enum class MatchOutcome {
  kMatched,    ///< id and timestamp name the same trigger
  kRealigned,  ///< the timestamp names another trigger than the id: the camera missed an edge or
               ///< skipped an id
  kRepeated,   ///< the trigger has its frame already
  kUnknown,    ///< belongs to no trigger
};

struct FrameMatch {
  MatchOutcome outcome = MatchOutcome::kUnknown;
  TriggerEdge edge;              ///< valid for kMatched, kRealigned and kRepeated
  std::int64_t residual_ns = 0;  ///< frame's time on the host clock minus the edge's actual time
  std::int64_t id_jump = 0;      ///< of kRealigned: ids that ran ahead (> 0) or fell behind (< 0)
};

/// Assigns one camera's frames to triggers: by unwrapped frame id, verified by the camera's
/// timestamp mapped to the host clock, which must fall within half a period of the edge. Order of
/// arrival plays no part. The clock mapping follows slow drift of the camera's clock.
class FrameMatcher {
 public:
  FrameMatcher(const CameraSync& sync, std::int64_t period_ns);

  /// `complete` = false: packets were lost, so the timestamp may be stale and only the id counts.
  FrameMatch Match(std::int64_t frame_id, std::uint64_t device_time_ns, bool complete,
                   const TriggerLog& log);

  /// Frame ids count anew and the camera's clock was set anew: the next whole frame is placed by its
  /// timestamp and ties the ids again.
  void Retie(std::int64_t host_minus_device_ns);

 private:
  FrameMatch Claim(MatchOutcome outcome, const TriggerEdge& edge, std::int64_t residual_ns);

  std::optional<std::int64_t> id_of_trigger_zero_;  ///< empty after Retie
  std::int64_t offset_ns_;
  std::int64_t window_ns_;
  std::set<std::int64_t> taken_;
};

}  // namespace sole::capture
