#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "capture/take_folder_internal.h"

namespace sole::capture {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// A take of 100 triggers and two cameras, the second of which lost `lost`.
RecordResult TakeThatLost(const std::vector<std::int64_t>& lost) {
  RecordResult result;
  result.state = "complete";
  result.triggers = 100;
  result.cameras.resize(2);
  for (CameraRecord& camera : result.cameras) {
    camera.serial = "A";
    camera.expected = camera.good = 100;
  }
  CameraRecord& camera = result.cameras[1];
  camera.serial = "B";
  camera.lost = static_cast<std::int64_t>(lost.size());
  camera.good -= camera.lost;
  camera.lost_triggers = lost;
  return result;
}

RecordResult Judged(RecordResult result) {
  Judge(result, 100, 0.02);
  return result;
}

TEST(Judge, NothingMissingIsGood) {
  const RecordResult result = Judged(TakeThatLost({}));
  EXPECT_EQ(result.verdict, "good");
  EXPECT_THAT(result.reasons, IsEmpty());
}

TEST(Judge, LossUpToTheLimitIsUsableBeyondItRepeat) {
  EXPECT_EQ(Judged(TakeThatLost({7, 8})).verdict, "usable");
  EXPECT_EQ(Judged(TakeThatLost({7, 8, 9})).verdict, "repeat");
}

TEST(Judge, IncompleteFramesCountLikeLostOnes) {
  RecordResult result = TakeThatLost({7, 8});
  result.cameras[1].incomplete = 1;
  --result.cameras[1].good;
  result = Judged(result);
  EXPECT_EQ(result.verdict, "repeat");
  EXPECT_THAT(result.reasons, ElementsAre(HasSubstr("2 of 100 frames lost"),
                                          HasSubstr("1 of 100 frames incomplete")));
}

TEST(Judge, ReasonsNameCameraAndTriggers) {
  EXPECT_THAT(Judged(TakeThatLost({4, 7, 8, 9, 20, 21})).reasons,
              ElementsAre("camera B: 6 of 100 frames lost (triggers 4, 7 to 9, 20, 21)"));
  EXPECT_THAT(Judged(TakeThatLost({1, 3, 5, 7, 9, 11, 13})).reasons,
              ElementsAre("camera B: 7 of 100 frames lost (triggers 1, 3, 5, 7, 9 and 2 more)"));
}

TEST(Judge, AbortedOrEmptyTakesAreRepeatedAndStoppedOnesUsable) {
  RecordResult aborted = TakeThatLost({});
  aborted.state = "aborted";
  aborted.reasons = {"disk full"};
  EXPECT_EQ(Judged(aborted).verdict, "repeat");
  RecordResult empty;
  empty.state = "complete";
  EXPECT_EQ(Judged(empty).verdict, "repeat");
  RecordResult stopped = TakeThatLost({});
  stopped.stopped = true;
  stopped.triggers = 40;
  stopped = Judged(stopped);
  EXPECT_EQ(stopped.verdict, "usable");
  EXPECT_THAT(stopped.reasons, ElementsAre("stopped after 40 of 100 triggers"));
}

TEST(TriggerRecords, TimesAreRelativeToTheFirstScheduledTrigger) {
  const std::vector<TriggerEdge> edges = {
      {1, ExposureKind::kSpeckle, 1'000'000'000, 1'000'060'000},
      {2, ExposureKind::kTexture, 1'100'000'000, 1'104'000'000}};
  const auto records = TriggerRecords(edges, 0.004);
  ASSERT_EQ(records.size(), 2u);
  EXPECT_NEAR(records[0].scheduled_s, 0, 1e-12);
  EXPECT_NEAR(records[0].actual_s, 60e-6, 1e-12);
  EXPECT_NEAR(records[1].scheduled_s, 0.1, 1e-12);
  EXPECT_NEAR(records[1].exposure_start_s, 0.104, 1e-12);
  EXPECT_NEAR(records[1].exposure_end_s, 0.108, 1e-12);
  EXPECT_EQ(records[1].kind, ExposureKind::kTexture);
}

}  // namespace
}  // namespace sole::capture
