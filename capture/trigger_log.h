#pragma once

#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

#include "core/frame_set.h"

namespace sole::capture {

/// One edge on the trigger line. Times are host nanoseconds (HostNowNs).
struct TriggerEdge {
  std::int64_t sequence = 0;  ///< counts from 1; 0 or less = warm-up
  ExposureKind kind = ExposureKind::kSpeckle;
  std::int64_t scheduled_ns = 0;
  std::int64_t actual_ns = 0;  ///< taken just before the edge goes out
};

/// The edges fired so far, in order of time. Safe to use from several threads.
class TriggerLog {
 public:
  void Append(const TriggerEdge& edge);
  std::optional<TriggerEdge> Find(std::int64_t sequence) const;
  /// The edge whose actual time is nearest to `host_ns`.
  std::optional<TriggerEdge> Nearest(std::int64_t host_ns) const;
  std::vector<TriggerEdge> Edges() const;
  std::int64_t Size() const;

 private:
  mutable std::mutex mutex_;
  std::vector<TriggerEdge> edges_;
};

}  // namespace sole::capture
