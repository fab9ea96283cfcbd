#include "capture/trigger_log.h"

#include <algorithm>

namespace sole::capture {

void TriggerLog::Append(const TriggerEdge& edge) {
  const std::lock_guard lock(mutex_);
  edges_.push_back(edge);
}

std::optional<TriggerEdge> TriggerLog::Find(std::int64_t sequence) const {
  const std::lock_guard lock(mutex_);
  const auto found =
      std::lower_bound(edges_.begin(), edges_.end(), sequence,
                       [](const TriggerEdge& e, std::int64_t s) { return e.sequence < s; });
  if (found == edges_.end() || found->sequence != sequence) return {};
  return *found;
}

std::optional<TriggerEdge> TriggerLog::Nearest(std::int64_t host_ns) const {
  const std::lock_guard lock(mutex_);
  if (edges_.empty()) return {};
  auto after =
      std::lower_bound(edges_.begin(), edges_.end(), host_ns,
                       [](const TriggerEdge& e, std::int64_t t) { return e.actual_ns < t; });
  if (after == edges_.end()) return edges_.back();
  if (after == edges_.begin()) return *after;
  const auto before = std::prev(after);
  return host_ns - before->actual_ns <= after->actual_ns - host_ns ? *before : *after;
}

std::vector<TriggerEdge> TriggerLog::Edges() const {
  const std::lock_guard lock(mutex_);
  return edges_;
}

std::int64_t TriggerLog::Size() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::int64_t>(edges_.size());
}

}  // namespace sole::capture
