// Several cameras at a fixed rate, every byte and every stamp checked; camera_rate_test.cpp has the
// full size.
#include "tests/sim/camera_load.h"

#include <gtest/gtest.h>

namespace sole::sim {
namespace {

/// Small and slow enough for a machine that does other things as well.
CameraLoadOptions SmallLoad(LoadTrigger trigger, double drop) {
  return {.cameras = 6,
          .width = 320,
          .height = 240,
          .rate_hz = 8,
          .triggers = 16,
          .sets = 5,
          .packet_drop_probability = drop,
          .packet_size = 1500,
          .trigger = trigger,
          .net = 113,
          .frame_retention_s = 5};
}

TEST(CameraLoad, LineTriggersEveryCameraThroughEverySet) {
  const CameraLoadOptions options = SmallLoad(LoadTrigger::kLine, 0);
  const CameraLoadResult result = RunCameraLoad(options);
  EXPECT_EQ(result.right, 96) << Describe(options, result);
  EXPECT_EQ(result.packets_dropped, 0);
}

TEST(CameraLoad, BroadcastActionTriggersEveryCameraAndLossIsRepaired) {
  const CameraLoadOptions options = SmallLoad(LoadTrigger::kAction, 0.01);
  const CameraLoadResult result = RunCameraLoad(options);
  EXPECT_EQ(result.right, 96) << Describe(options, result);
  EXPECT_GT(result.packets_dropped, 20);  // Of 96 frames of 55 packets.
  EXPECT_GT(result.packets_resent, 10);
}

}  // namespace
}  // namespace sole::sim
