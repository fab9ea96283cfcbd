#include "capture/frame_matcher.h"

#include <cmath>
#include <cstdlib>

namespace sole::capture {
namespace {

// Share of each residual that the clock mapping follows: averages trigger jitter over about ten
// frames, while 100 ppm of drift at 1 Hz lags by 1 ms only.
constexpr std::int64_t kFollow = 10;

}  // namespace

FrameMatcher::FrameMatcher(const CameraSync& sync, std::int64_t period_ns)
    : id_of_trigger_zero_(sync.frame_id),
      offset_ns_(sync.host_minus_device_ns),
      window_ns_(period_ns / 2) {}

void FrameMatcher::Retie(std::int64_t host_minus_device_ns) {
  offset_ns_ = host_minus_device_ns;
  id_of_trigger_zero_.reset();
}

FrameMatch FrameMatcher::Claim(MatchOutcome outcome, const TriggerEdge& edge,
                               std::int64_t residual_ns) {
  if (!taken_.insert(edge.sequence).second) return {MatchOutcome::kRepeated, edge, residual_ns, 0};
  return {outcome, edge, residual_ns, 0};
}

FrameMatch FrameMatcher::Match(std::int64_t frame_id, std::uint64_t device_time_ns, bool complete,
                               const TriggerLog& log) {
  const std::int64_t time_ns = static_cast<std::int64_t>(device_time_ns) + offset_ns_;
  const std::optional<TriggerEdge> by_id =
      id_of_trigger_zero_ ? log.Find(frame_id - *id_of_trigger_zero_) : std::nullopt;
  if (by_id) {
    const std::int64_t residual = time_ns - by_id->actual_ns;
    if (!complete) return Claim(MatchOutcome::kMatched, *by_id, 0);
    if (std::abs(residual) < window_ns_) {
      const FrameMatch match = Claim(MatchOutcome::kMatched, *by_id, residual);
      if (match.outcome == MatchOutcome::kMatched) offset_ns_ -= residual / kFollow;
      return match;
    }
  }
  if (!complete) return {};
  const std::optional<TriggerEdge> by_time = log.Nearest(time_ns);
  if (!by_time || std::abs(time_ns - by_time->actual_ns) >= window_ns_) return {};
  const MatchOutcome outcome =
      id_of_trigger_zero_ ? MatchOutcome::kRealigned : MatchOutcome::kMatched;
  FrameMatch match = Claim(outcome, *by_time, time_ns - by_time->actual_ns);
  if (match.outcome == outcome) {
    const std::int64_t zero = frame_id - by_time->sequence;
    match.id_jump = zero - id_of_trigger_zero_.value_or(zero);
    id_of_trigger_zero_ = zero;
  }
  return match;
}

}  // namespace sole::capture
