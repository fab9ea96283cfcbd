#include "capture/frame_id.h"

#include <algorithm>

namespace sole::capture {
namespace {

constexpr std::int64_t kCycle = 65535;

}  // namespace

std::int64_t FrameIdUnwrapper::Unwrap(std::uint64_t id) {
  const auto value = static_cast<std::int64_t>(id);
  if (!newest_ || value > kCycle || *newest_ < 0) {
    newest_ = std::max(newest_.value_or(value), value);
    return value;
  }
  std::int64_t step = (value - *newest_) % kCycle;
  if (step < -kCycle / 2) step += kCycle;
  if (step > kCycle / 2) step -= kCycle;
  const std::int64_t unwrapped = *newest_ + step;
  newest_ = std::max(*newest_, unwrapped);
  return unwrapped;
}

}  // namespace sole::capture
