// Device clocks: offset and drift of their own, synchronised by PTP.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <string>
#include <thread>

#include "sim/camera_server.h"
#include "sim/gige/device_clock.h"
#include "tests/sim/gige_client.h"
#include "tests/sim/served_rig.h"

namespace sole::sim {
namespace {

constexpr std::int64_t kSecond = 1000000000;

TEST(DeviceClock, DriftsFromItsOffsetAndKeepsWhatItHasWhenDriftChanges) {
  DeviceClock clock(5 * kSecond, 7000, 20);
  EXPECT_EQ(clock.At(5 * kSecond), 5 * kSecond + 7000);
  EXPECT_EQ(clock.At(6 * kSecond), 6 * kSecond + 7000 + 20000);
  EXPECT_EQ(clock.At(0), 7000) << "before it was set";
  clock.SetDrift(6 * kSecond, -10);
  EXPECT_EQ(clock.At(8 * kSecond), 8 * kSecond + 27000 - 20000);
  EXPECT_EQ(clock.Status(8 * kSecond), kPtpDisabled);
}

TEST(DeviceClock, PtpClosesInMonotonicallyAndDriftReturnsWithoutIt) {
  DeviceClock clock(0, 1000000, 50);
  clock.SetPtp(kSecond, true);
  EXPECT_NEAR(clock.ErrorNs(kSecond), 1050000, 1);
  EXPECT_EQ(clock.Status(kSecond), kPtpUncalibrated);
  EXPECT_LT(clock.ErrorNs(kSecond + kSecond / 10), 0.4 * 1050000);
  EXPECT_EQ(clock.Status(3 * kSecond), kPtpSlave);
  EXPECT_NEAR(clock.ErrorNs(4 * kSecond), 0, 1);
  clock.SetPtp(4 * kSecond, false);
  EXPECT_NEAR(clock.ErrorNs(5 * kSecond), 50000, 1);
}

/// The server's camera with a clock 5 s ahead.
struct FastCamera {
  ImageU8 image{64, 64};
  CameraServer server{{{.serial = "CLOCK",
                        .address = "127.0.103.1",
                        .width = 64,
                        .height = 64,
                        .exposure_us = 100,
                        .clock_offset_ns = 5 * kSecond}},
                      0,
                      [this](int, const TriggerPulse&) -> const ImageU8& { return image; }};
};

TEST(CameraClock, PtpFeaturesSynchroniseTimestamps) {
  const FastCamera rig;
  ArvClient client("127.0.103.1");
  ArvCamera* camera = client.Camera();
  ASSERT_NE(camera, nullptr);
  const auto status = [&] {
    return std::string(arv_camera_get_string(camera, "GevIEEE1588Status", SOLE_ARV_OK));
  };
  const auto offset = [&] {
    arv_camera_execute_command(camera, "GevIEEE1588DataSetLatch", SOLE_ARV_OK);
    return arv_camera_get_integer(camera, "GevIEEE1588OffsetFromMaster", SOLE_ARV_OK);
  };
  client.Start("Line1");
  const RawClient raw;
  const auto error_of_frame = [&](std::int64_t sequence) {
    const std::int64_t now = NowNs();
    raw.Pulse(rig.server.BusPort(), {.sequence = sequence, .scheduled_ns = now});
    const auto frame = client.Next();
    return frame ? static_cast<std::int64_t>(frame->timestamp_ns) - now : -1;
  };
  EXPECT_FALSE(arv_camera_get_boolean(camera, "GevIEEE1588", SOLE_ARV_OK));
  EXPECT_EQ(status(), "Disabled");
  EXPECT_EQ(offset(), 5 * kSecond);
  EXPECT_EQ(error_of_frame(1), 5 * kSecond);

  arv_camera_set_boolean(camera, "GevIEEE1588", TRUE, SOLE_ARV_OK);
  EXPECT_EQ(status(), "Uncalibrated");
  for (int i = 0; i < 600 && status() != "Slave"; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_EQ(status(), "Slave");
  EXPECT_LE(offset(), 1000);
  EXPECT_LE(std::abs(error_of_frame(2)), 1000);
}

}  // namespace
}  // namespace sole::sim
