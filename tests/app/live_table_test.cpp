#include "app/live_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sole::app {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

capture::RecordProgress Progress() {
  capture::RecordProgress progress;
  progress.phase = capture::TakePhase::kRecording;
  progress.fired = 42;
  progress.triggers = 100;
  progress.frames = 83;
  progress.trigger_jitter_s = 0.0012;
  progress.disk_left_s = 3725;
  capture::CameraStatus camera;
  camera.serial = "CAM1";
  camera.frames = 42;
  camera.saturated = 0.0123;
  camera.focus = 0.41;
  camera.latency_s = 0.0356;
  camera.sync_s = -0.00025;
  progress.cameras.push_back(camera);
  camera.serial = "CAM2";
  camera.lost = 4;
  camera.silent = true;
  progress.cameras.push_back(camera);
  return progress;
}

TEST(FormatStatus, OneLineSaysWhatMatters) {
  const std::string text = FormatStatus(Progress(), false);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1);
  EXPECT_THAT(text, HasSubstr("recording 42 of 100 triggers, 83 frames stored, 4 missing"));
  EXPECT_THAT(text, HasSubstr("jitter 1.2 ms, sync 0.2 ms, disk 1:02:05"));
  EXPECT_THAT(text, HasSubstr("1 CAMERAS SILENT"));
}

TEST(FormatStatus, TableHasALineForEveryCameraInColumns) {
  const std::string text = FormatStatus(Progress(), true);
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 4);
  EXPECT_THAT(text, HasSubstr("CAM1              42     0       0   1.23   0.41      0     35.6    -0.25  ok"));
  EXPECT_THAT(text, HasSubstr("SILENT\n"));
  auto open_end = Progress();
  open_end.triggers = 0;
  EXPECT_THAT(FormatStatus(open_end, false), Not(HasSubstr(" of ")));
}

}  // namespace
}  // namespace sole::app
