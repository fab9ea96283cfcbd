// The full rig at its rate: 20 cameras of 1624 x 1236 at 10 Hz for a minute, cycling through 20
// sets of images, without loss and with 0.2 % of the packets lost, by line and by action command.
// Needs the machine for itself (half a core, 2.5 GB).
#include <gtest/gtest.h>

#include "tests/sim/camera_load.h"

namespace sole::sim {
namespace {

void ExpectNoFrameLost(LoadTrigger trigger, double drop) {
  const CameraLoadOptions options{.packet_drop_probability = drop, .trigger = trigger, .net = 114};
  const CameraLoadResult result = RunCameraLoad(options);
  std::printf("%s\n", Describe(options, result).c_str());
  EXPECT_EQ(result.asked, 12000);
  EXPECT_EQ(result.right, 12000);
  EXPECT_EQ(result.resends_refused, 0);
  if (drop > 0) {
    EXPECT_GT(result.packets_dropped, 4000) << "of 2.7 million";
    EXPECT_GE(result.packets_resent, result.packets_dropped - 50);
  }
}

TEST(CameraRate, Line) { ExpectNoFrameLost(LoadTrigger::kLine, 0); }
TEST(CameraRate, LineWithLoss) { ExpectNoFrameLost(LoadTrigger::kLine, 0.002); }
TEST(CameraRate, Action) { ExpectNoFrameLost(LoadTrigger::kAction, 0); }
TEST(CameraRate, ActionWithLoss) { ExpectNoFrameLost(LoadTrigger::kAction, 0.002); }

}  // namespace
}  // namespace sole::sim
