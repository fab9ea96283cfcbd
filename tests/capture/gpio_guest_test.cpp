// Runs inside the virtual machine of gpio_vm.sh, on a gpio-sim chip: SOLE_GPIO_CHIP is its name,
// SOLE_GPIO_SYSFS the folder of the chip whose sim_gpioN/value tells what a line's consumer drives
// and whose sim_gpioN/pull drives an input.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "capture/host_clock.h"
#include "capture/trigger.h"
#include "core/error.h"
#include "tests/support/error_matcher.h"

namespace sole::capture {
namespace {

using testing_support::ErrorOf;

// Lines as gpio_vm.sh names them.
constexpr int kTrigger = 0, kSpeckleStrobe = 1, kTextureStrobe = 2, kReadback = 3;

std::string Chip() { return std::getenv("SOLE_GPIO_CHIP"); }
std::string Attribute(int line, const char* name) {
  return std::string(std::getenv("SOLE_GPIO_SYSFS")) + "/sim_gpio" + std::to_string(line) + "/" +
         name;
}
bool IsHigh(int line) { return std::ifstream(Attribute(line, "value")).get() == '1'; }
void Drive(int line, bool high) {
  std::ofstream(Attribute(line, "pull")) << (high ? "pull-up" : "pull-down") << std::flush;
}

GpioTriggerOptions Lines() {
  GpioTriggerOptions options;
  options.chip = Chip();
  options.line = "trigger";
  options.pulse_us = 60'000;
  options.strobes = {{"speckle", {ExposureKind::kSpeckle}, 60'000},
                     {"2", {ExposureKind::kTexture}, 60'000}};
  options.readback_line = "exposure";
  return options;
}

/// Cameras that expose for 20 ms at every rising edge of the trigger line, seen by polling.
class Cameras {
 public:
  struct Pulse {
    std::int64_t seen_ns, ended_ns;
    bool speckle, texture;
  };
  explicit Cameras(int miss = -1) : thread_([this, miss] { Run(miss); }) {}
  std::vector<Pulse> Finish() {
    stop_ = true;
    thread_.join();
    return pulses_;
  }

 private:
  void Run(int miss) {
    while (!stop_) {
      if (!IsHigh(kTrigger)) {
        usleep(500);
        continue;
      }
      const std::int64_t seen = HostNowNs();
      const bool answers = static_cast<int>(pulses_.size()) != miss;
      if (answers) Drive(kReadback, true);
      pulses_.push_back({seen, 0, IsHigh(kSpeckleStrobe), IsHigh(kTextureStrobe)});
      usleep(20'000);
      if (answers) Drive(kReadback, false);
      while (IsHigh(kTrigger)) usleep(500);
      pulses_.back().ended_ns = HostNowNs();
    }
  }

  std::atomic<bool> stop_{false};
  std::vector<Pulse> pulses_;
  std::thread thread_;
};

/// Starts in 50 ms; slow, for an emulated processor.
TriggerSchedule ScheduleOf(std::int64_t count) {
  return {.start_ns = HostNowNs() + 50'000'000,
          .period_ns = 300'000'000,
          .count = count,
          .cycle = {ExposureKind::kSpeckle, ExposureKind::kTexture}};
}

TEST(GpioTrigger, PulsesStrobesAndEchoesFollowTheSchedule) {
  const auto trigger = MakeGpioTrigger(Lines());
  EXPECT_FALSE(IsHigh(kTrigger));
  EXPECT_TRUE(trigger->ReadsBack());
  Cameras cameras;
  TriggerLog log;
  TriggerSchedule schedule = ScheduleOf(8);
  schedule.gap_ns = 150'000'000;
  ASSERT_EQ(FireSchedule(*trigger, schedule, log), 8);
  usleep(150'000);
  const auto pulses = cameras.Finish();
  const auto echoes = trigger->Echoes();
  ASSERT_EQ(pulses.size(), 8u);
  ASSERT_EQ(echoes.size(), 8u);
  for (std::int64_t i = 0; i < 8; ++i) {
    const auto edge = *log.Find(i + 1);
    const auto& pulse = pulses[static_cast<std::size_t>(i)];
    const auto& echo = echoes[static_cast<std::size_t>(i)];
    EXPECT_EQ(pulse.speckle, i % 2 == 0) << "edge " << i;
    EXPECT_EQ(pulse.texture, i % 2 == 1) << "edge " << i;
    // Kernel time stamps on the scale of the trigger log, between cause and the next edge.
    EXPECT_GT(echo.start_ns, edge.actual_ns);
    EXPECT_LT(echo.start_ns, edge.actual_ns + 140'000'000);
    EXPECT_GE(echo.end_ns - echo.start_ns, 20'000'000);
    EXPECT_GE(pulse.ended_ns - edge.actual_ns, 60'000'000) << "the pulse is shorter than asked";
  }
}

TEST(GpioTrigger, AnEdgeThatCamerasMissHasNoEcho) {
  const auto trigger = MakeGpioTrigger(Lines());
  Cameras cameras(2);
  TriggerLog log;
  FireSchedule(*trigger, ScheduleOf(4), log);
  usleep(200'000);
  EXPECT_EQ(cameras.Finish().size(), 4u);
  const auto echoes = trigger->Echoes();
  ASSERT_EQ(echoes.size(), 3u);
  EXPECT_GT(echoes[2].start_ns, log.Find(4)->actual_ns);
}

TEST(GpioTrigger, LinesInUseAndUnknownLinesAreNamed) {
  const auto trigger = MakeGpioTrigger(Lines());
  EXPECT_THAT(ErrorOf([] { MakeGpioTrigger(Lines()); }), ::testing::HasSubstr("trigger"));
  GpioTriggerOptions other;
  other.chip = Chip();
  other.line = "shutter";
  EXPECT_THAT(ErrorOf([&] { MakeGpioTrigger(other); }),
              ::testing::AllOf(::testing::HasSubstr("shutter"), ::testing::HasSubstr(Chip())));
}

TEST(GpioTrigger, LinesAreLowWhenItIsGone) {
  { MakeGpioTrigger(Lines())->Emit({.sequence = 1}); }
  EXPECT_FALSE(IsHigh(kTrigger));
  EXPECT_FALSE(IsHigh(kSpeckleStrobe));
}

TEST(RealtimeScope, RunsBelowPriorityFiftyWhereAllowed) {
  std::vector<std::string> warnings;
  const RealtimeScope scope([&](const std::string& line) { warnings.push_back(line); });
  sched_param param{};
  ASSERT_EQ(sched_getparam(0, &param), 0);
  EXPECT_EQ(sched_getscheduler(0), SCHED_FIFO);
  EXPECT_GT(param.sched_priority, 0);
  EXPECT_LT(param.sched_priority, 50);
  EXPECT_THAT(warnings, ::testing::IsEmpty());
}

}  // namespace
}  // namespace sole::capture
