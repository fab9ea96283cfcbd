#include "capture/frame_matcher.h"

#include <gtest/gtest.h>

namespace sole::capture {
namespace {

constexpr std::int64_t kPeriod = 100'000'000;
constexpr std::int64_t kStart = 1'700'000'000'000'000'000;
constexpr std::int64_t kDeviceBehind = 1'699'999'000'000'000'000;  // host minus device clock
constexpr std::int64_t kSyncId = 3;                                // id of the last warm-up frame

/// Triggers 1 to n on time; frames carry id kSyncId + trigger.
class FrameMatcherTest : public ::testing::Test {
 protected:
  void Fire(std::int64_t n) {
    for (std::int64_t i = 1; i <= n; ++i) {
      const std::int64_t time = kStart + i * kPeriod;
      log.Append({i, ExposureKind::kSpeckle, time, time + 60'000});
    }
  }
  static std::uint64_t DeviceTime(double trigger) {
    return static_cast<std::uint64_t>(kStart - kDeviceBehind +
                                      static_cast<std::int64_t>(trigger * kPeriod));
  }
  FrameMatch Match(std::int64_t id, double device_trigger, bool complete = true) {
    return matcher.Match(id, DeviceTime(device_trigger), complete, log);
  }
  void ExpectMatched(const FrameMatch& match, std::int64_t trigger) {
    EXPECT_EQ(match.outcome, MatchOutcome::kMatched);
    EXPECT_EQ(match.edge.sequence, trigger);
  }

  TriggerLog log;
  FrameMatcher matcher{{kSyncId, kDeviceBehind}, kPeriod};
};

TEST_F(FrameMatcherTest, IdsAndTimesAgree) {
  Fire(5);
  for (int i = 1; i <= 5; ++i) ExpectMatched(Match(kSyncId + i, i), i);
}

TEST_F(FrameMatcherTest, GapLeavesOtherFramesInPlace) {
  Fire(5);
  ExpectMatched(Match(kSyncId + 1, 1), 1);
  ExpectMatched(Match(kSyncId + 4, 4), 4);
  ExpectMatched(Match(kSyncId + 5, 5), 5);
}

TEST_F(FrameMatcherTest, LateFrameGoesToItsOwnTrigger) {
  Fire(5);
  ExpectMatched(Match(kSyncId + 1, 1), 1);
  ExpectMatched(Match(kSyncId + 3, 3), 3);
  ExpectMatched(Match(kSyncId + 2, 2), 2);
}

TEST_F(FrameMatcherTest, RepeatedFrameIsNotStoredTwice) {
  Fire(3);
  ExpectMatched(Match(kSyncId + 2, 2), 2);
  EXPECT_EQ(Match(kSyncId + 2, 2).outcome, MatchOutcome::kRepeated);
  ExpectMatched(Match(kSyncId + 3, 3), 3);
}

TEST_F(FrameMatcherTest, MissedEdgeIsFoundByTimeAndRealignsIds) {
  Fire(5);
  ExpectMatched(Match(kSyncId + 1, 1), 1);
  // The camera did not see edge 2: its next frame, id 2, was exposed at edge 3.
  const FrameMatch moved = Match(kSyncId + 2, 3);
  EXPECT_EQ(moved.outcome, MatchOutcome::kRealigned);
  EXPECT_EQ(moved.edge.sequence, 3);
  EXPECT_EQ(moved.id_jump, -1);
  ExpectMatched(Match(kSyncId + 3, 4), 4);
  ExpectMatched(Match(kSyncId + 4, 5), 5);
}

TEST_F(FrameMatcherTest, SkippedIdIsFoundByTimeAlsoWhenItsTriggerIsStillToCome) {
  Fire(2);
  ExpectMatched(Match(kSyncId + 1, 1), 1);
  const FrameMatch moved = Match(kSyncId + 3, 2);
  EXPECT_EQ(moved.outcome, MatchOutcome::kRealigned);
  EXPECT_EQ(moved.edge.sequence, 2);
  EXPECT_EQ(moved.id_jump, 1);
}

TEST_F(FrameMatcherTest, RepeatedTimestampDoesNotPassAsTheNextTrigger) {
  Fire(3);
  ExpectMatched(Match(kSyncId + 1, 1), 1);
  EXPECT_EQ(Match(kSyncId + 2, 1).outcome, MatchOutcome::kRepeated);
  ExpectMatched(Match(kSyncId + 3, 3), 3);
}

TEST_F(FrameMatcherTest, FrameBetweenOrBeforeTriggersIsUnknown) {
  Fire(3);
  EXPECT_EQ(Match(kSyncId, 0).outcome, MatchOutcome::kUnknown);  // a warm-up frame that comes late
  EXPECT_EQ(Match(kSyncId + 9, 3.6).outcome, MatchOutcome::kUnknown);
}

TEST_F(FrameMatcherTest, IncompleteFrameCountsByIdOnly) {
  Fire(3);
  ExpectMatched(Match(kSyncId + 2, -50, false), 2);
  EXPECT_EQ(Match(kSyncId + 7, 2, false).outcome, MatchOutcome::kUnknown);
}

TEST_F(FrameMatcherTest, AfterRetieTimesPlaceTheFirstFrameAndIdsTheNext) {
  Fire(8);
  ExpectMatched(Match(kSyncId + 1, 1), 1);
  matcher.Retie(kDeviceBehind + 77);  // the camera restarted: ids from 1, a clock set anew
  EXPECT_EQ(Match(1, 5, false).outcome, MatchOutcome::kUnknown);  // without its packets no time
  ExpectMatched(Match(2, 6), 6);
  ExpectMatched(Match(3, -50, false), 7);
  EXPECT_EQ(Match(4, 6).outcome, MatchOutcome::kRepeated);
}

TEST_F(FrameMatcherTest, FollowsADriftingClockFarBeyondTheWindow) {
  Fire(4000);
  constexpr double kDrift = 1 + 500e-6;  // 0.2 s after 4000 triggers, four times the window
  for (int i = 1; i <= 4000; ++i) {
    const FrameMatch match = Match(kSyncId + i, i * kDrift);
    ASSERT_EQ(match.outcome, MatchOutcome::kMatched) << "trigger " << i;
    ASSERT_EQ(match.edge.sequence, i);
  }
}

}  // namespace
}  // namespace sole::capture
