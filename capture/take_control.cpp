#include "capture/take_control.h"

namespace sole::capture {

const char* ToString(TakePhase phase) {
  switch (phase) {
    case TakePhase::kWaiting:
      return "waiting";
    case TakePhase::kRecording:
      return "recording";
    case TakePhase::kPostRoll:
      return "post-roll";
    case TakePhase::kDone:
      return "done";
  }
  return "unknown";
}

TakeControl::TakeControl(const TakeControlOptions& options) : options_(options) {}

void TakeControl::Begin(std::int64_t now_ns, std::int64_t since_ns) {
  phase_ = TakePhase::kRecording;
  start_ns_ = since_ns;
  begun_ns_ = now_ns;
}

void TakeControl::End(std::int64_t now_ns) {
  end_ns_ = now_ns + options_.post_roll_ns;
  phase_ = options_.post_roll_ns > 0 ? TakePhase::kPostRoll : TakePhase::kDone;
}

TakePhase TakeControl::Update(std::int64_t now_ns, bool key, bool foot) {
  if (foot_since_ns_ < 0 || foot != foot_) {
    foot_ = foot;
    foot_since_ns_ = now_ns;
  }
  const bool settled = now_ns - foot_since_ns_ >= options_.foot_settle_ns;
  switch (phase_) {
    case TakePhase::kWaiting:
      empty_ = empty_ || (settled && !foot);
      if (options_.start == StartOn::kAtOnce) {
        Begin(now_ns, now_ns);
      } else if (key) {  // the operator's word counts in every mode
        Begin(now_ns, now_ns);
      } else if (options_.start == StartOn::kFoot && settled && foot && empty_) {
        Begin(now_ns, foot_since_ns_);
      }
      break;
    case TakePhase::kRecording:
      seen_ = seen_ || (settled && foot);
      if (key) {
        End(now_ns);
      } else if (options_.stop_on_foot_off && seen_ && settled && !foot) {
        End(now_ns);
      } else if (options_.longest_ns > 0 && now_ns - begun_ns_ >= options_.longest_ns) {
        phase_ = TakePhase::kDone;
      }
      break;
    case TakePhase::kPostRoll:
      if (key || now_ns >= end_ns_) phase_ = TakePhase::kDone;
      break;
    case TakePhase::kDone:
      break;
  }
  return phase_;
}

}  // namespace sole::capture
