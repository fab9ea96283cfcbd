#include "capture/take_control.h"

#include <gtest/gtest.h>

namespace sole::capture {
namespace {

constexpr std::int64_t kMs = 1'000'000;

/// Looks every 10 ms from `from` to below `to` (ms) with the same inputs; the phase at the end.
TakePhase Look(TakeControl& control, std::int64_t from, std::int64_t to, bool foot) {
  for (std::int64_t t = from; t < to; t += 10) control.Update(t * kMs, false, foot);
  return control.Phase();
}

TEST(TakeControl, AtOnceBeginsWithTheFirstLookAndEndsByTime) {
  TakeControl control({.longest_ns = 500 * kMs});
  EXPECT_EQ(control.Update(1000 * kMs, false, false), TakePhase::kRecording);
  EXPECT_EQ(control.StartNs(), 1000 * kMs);
  EXPECT_EQ(Look(control, 1010, 1500, false), TakePhase::kRecording);
  EXPECT_EQ(control.Update(1500 * kMs, false, false), TakePhase::kDone);
}

TEST(TakeControl, KeyStartsAndStopsWithPostRoll) {
  TakeControl control({.start = StartOn::kKey, .post_roll_ns = 200 * kMs});
  EXPECT_EQ(Look(control, 0, 1000, true), TakePhase::kWaiting) << "a foot does not start it";
  EXPECT_EQ(control.Update(1000 * kMs, true, false), TakePhase::kRecording);
  EXPECT_EQ(Look(control, 1010, 3000, false), TakePhase::kRecording);
  EXPECT_EQ(control.Update(3000 * kMs, true, false), TakePhase::kPostRoll);
  EXPECT_EQ(Look(control, 3010, 3200, false), TakePhase::kPostRoll);
  EXPECT_EQ(control.Update(3200 * kMs, false, false), TakePhase::kDone);
}

TEST(TakeControl, FootStartsOnceItStaysAndTheStartIsWhenItCame) {
  TakeControl control({.start = StartOn::kFoot});
  EXPECT_EQ(Look(control, 0, 500, false), TakePhase::kWaiting);
  EXPECT_EQ(Look(control, 500, 600, true), TakePhase::kWaiting) << "passes by only";
  EXPECT_EQ(Look(control, 600, 1000, false), TakePhase::kWaiting);
  EXPECT_EQ(Look(control, 1000, 1300, true), TakePhase::kWaiting);
  EXPECT_EQ(control.Update(1300 * kMs, false, true), TakePhase::kRecording);
  EXPECT_EQ(control.StartNs(), 1000 * kMs);
}

TEST(TakeControl, FootThatWasThereBeforeMustLeaveFirst) {
  TakeControl control({.start = StartOn::kFoot});
  EXPECT_EQ(Look(control, 0, 2000, true), TakePhase::kWaiting);
  EXPECT_EQ(Look(control, 2000, 2400, false), TakePhase::kWaiting);
  EXPECT_EQ(Look(control, 2400, 2800, true), TakePhase::kRecording);
}

TEST(TakeControl, FootOffStopsOnlyAfterAFootWasOn) {
  TakeControl control({.stop_on_foot_off = true});
  EXPECT_EQ(Look(control, 0, 2000, false), TakePhase::kRecording);
  EXPECT_EQ(Look(control, 2000, 3000, true), TakePhase::kRecording);
  EXPECT_EQ(Look(control, 3000, 3200, false), TakePhase::kRecording) << "a swing, not the end";
  EXPECT_EQ(Look(control, 3200, 4000, true), TakePhase::kRecording);
  EXPECT_EQ(Look(control, 4000, 4300, false), TakePhase::kRecording);
  EXPECT_EQ(control.Update(4300 * kMs, false, false), TakePhase::kDone);
}

}  // namespace
}  // namespace sole::capture
