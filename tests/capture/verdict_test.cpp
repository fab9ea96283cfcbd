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

TEST(Judge, PulsesThatNoCameraSawAreTheLines) {
  RecordResult result = TakeThatLost({7, 8});
  result.cameras[0] = result.cameras[1];
  result.cameras[0].serial = "A";
  EXPECT_THAT(Judged(result).reasons,
              ElementsAre("no camera has a frame of triggers 7, 8: the trigger line missed pulses, "
                          "check its cable"));
}

TEST(Judge, LateCamerasFastClocksAndShiftsAreNamed) {
  RecordResult result = TakeThatLost({});
  result.cameras.push_back(result.cameras[0]);
  result.cameras[2].serial = "C";
  for (CameraRecord& camera : result.cameras) {
    camera.latency_warmup_s = 0.01;
    camera.latency_median_s = 0.012;
    camera.clock = ClockRate{40, 1, 100};  // within what crystals do
  }
  EXPECT_EQ(Judged(result).verdict, "good");
  result.cameras[0].latency_median_s = 0.06;
  result.cameras[1].clock = ClockRate{-90, 2, 100};
  const RecordResult usable = Judged(result);
  EXPECT_EQ(usable.verdict, "usable");
  EXPECT_THAT(usable.reasons, ElementsAre(HasSubstr("camera A: frames arrive late (60 ms"),
                                          HasSubstr("camera B: its clock runs 90 ppm slow")));
  result.cameras[1].clock = ClockRate{-90, 30, 6};  // too uncertain to tell
  result.cameras[2].shift = 2;
  const RecordResult repeat = Judged(result);
  EXPECT_EQ(repeat.verdict, "repeat");
  EXPECT_EQ(repeat.reasons.size(), 2u);
  EXPECT_THAT(repeat.reasons[1], HasSubstr("camera C: its images lag behind"));
}

TEST(TriggerRecords, ExposuresAreThoseReadBack) {
  const std::vector<TriggerEdge> edges = {{5, ExposureKind::kSpeckle, 1'000'000'000, 1'000'000'000},
                                          {6, ExposureKind::kSpeckle, 1'100'000'000, 1'100'000'000},
                                          {7, ExposureKind::kSpeckle, 1'200'000'000, 1'200'000'000}};
  const std::vector<ExposureEcho> echoes = {{900'000'000, 904'000'000},  // a warm-up's
                                            {1'000'010'000, 1'004'010'000},
                                            {1'200'020'000, 1'204'020'000}};
  const auto records = TriggerRecords(edges, 0.004, &echoes);
  ASSERT_EQ(records.size(), 3u);
  EXPECT_EQ(records[0].trigger, 1) << "a take counts from 1";
  EXPECT_NEAR(records[0].exposure_start_s, 10e-6, 1e-12);
  EXPECT_NEAR(records[0].exposure_end_s, 4.01e-3, 1e-12);
  EXPECT_EQ(records[1].exposure_end_s, records[1].exposure_start_s) << "not confirmed";
  EXPECT_NEAR(records[2].exposure_start_s, 0.2 + 20e-6, 1e-9);
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
