// Who may command a camera, and cameras that fail.
#include <chrono>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "sim/camera_server.h"
#include "tests/sim/gige_client.h"
#include "tests/sim/served_rig.h"

namespace sole::sim {
namespace {

using testing::HasSubstr;

constexpr std::uint32_t kControl = 0xA00, kHeartbeat = 0x938, kTriggerMode = 0x10204;

TEST(CameraControl, SecondControllerIsRefused) {
  const ServedRig rig(82, 1);
  const ArvClient first(rig.addresses[0]);
  ASSERT_TRUE(arv_gv_device_is_controller(ARV_GV_DEVICE(first.Device())));
  RawClient raw;
  EXPECT_EQ(raw.WriteRegister(rig.addresses[0], kControl, 2), 0x8006);
  EXPECT_EQ(raw.WriteRegister(rig.addresses[0], kControl, 0), 0x8006)
      << "nor may it end the first one's control";
  EXPECT_EQ(raw.WriteRegister(rig.addresses[0], kTriggerMode, 1), 0x8006);
  EXPECT_EQ(raw.ReadRegister(rig.addresses[0], kControl), 2U) << "anyone may read";

  const ArvClient second(rig.addresses[0]);
  ASSERT_NE(second.Camera(), nullptr);
  EXPECT_FALSE(arv_gv_device_is_controller(ARV_GV_DEVICE(second.Device())));
  GError* error = nullptr;
  arv_camera_set_exposure_time(second.Camera(), 500, &error);
  ASSERT_NE(error, nullptr);
  EXPECT_EQ(error->code, ARV_DEVICE_ERROR_PROTOCOL_ERROR_ACCESS_DENIED) << error->message;
  g_clear_error(&error);
  EXPECT_EQ(arv_camera_get_exposure_time(first.Camera(), SOLE_ARV_OK), 100);
}

TEST(CameraControl, ControlIsFreeAfterItIsReleased) {
  const ServedRig rig(82, 1);
  RawClient raw;
  {
    const ArvClient first(rig.addresses[0]);
    EXPECT_TRUE(rig.server->Stats()[0].controlled);
  }
  EXPECT_FALSE(rig.server->Stats()[0].controlled);
  EXPECT_EQ(raw.WriteRegister(rig.addresses[0], kControl, 2), 0);
}

TEST(CameraControl, SilentControllerLosesControlAfterTheHeartbeatTimeout) {
  const ServedRig rig(82, 1);
  const std::string& address = rig.addresses[0];
  RawClient silent, other;
  ASSERT_EQ(silent.WriteRegister(address, kControl, 2), 0);
  ASSERT_EQ(silent.WriteRegister(address, kHeartbeat, 400), 0);
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(silent.WriteRegister(address, 0xD00, 5555), 0);
  // The other's questions do not keep the silent one alive.
  while (other.ReadRegister(address, kControl) != 0U &&
         std::chrono::steady_clock::now() - begin < std::chrono::seconds(20)) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(390));
  EXPECT_EQ(other.ReadRegister(address, kControl), 0U);
  EXPECT_EQ(other.ReadRegister(address, 0xD00), 0U) << "its stream is closed";
  EXPECT_EQ(silent.WriteRegister(address, kTriggerMode, 1), 0x8006);
  EXPECT_EQ(other.WriteRegister(address, kControl, 2), 0);
}

TEST(CameraControl, HeartbeatKeepsControl) {
  const ServedRig rig(82, 1);
  const std::string& address = rig.addresses[0];
  RawClient alive;
  ASSERT_EQ(alive.WriteRegister(address, kControl, 2), 0);
  ASSERT_EQ(alive.WriteRegister(address, kHeartbeat, 2000), 0);
  for (int i = 0; i < 25; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    ASSERT_EQ(alive.ReadRegister(address, kControl), 2U) << "after " << i * 100 << " ms";
  }
}

TEST(CameraControl, ActionCommandTriggersMatchingCamerasOnly) {
  const ServedRig rig(82, 1);
  ArvClient client(rig.addresses[0]);
  arv_camera_set_integer(client.Camera(), "ActionDeviceKey", 77, SOLE_ARV_OK);
  arv_camera_set_integer(client.Camera(), "ActionGroupKey", 5, SOLE_ARV_OK);
  arv_camera_set_integer(client.Camera(), "ActionGroupMask", 6, SOLE_ARV_OK);
  client.Start("Action1");
  RawClient raw;
  raw.FireAction(rig.addresses[0], 78, 5, 2);
  raw.FireAction(rig.addresses[0], 77, 4, 2);
  raw.FireAction(rig.addresses[0], 77, 5, 9);
  raw.FireAction(rig.addresses[0], 77, 5, 2);
  const auto frame = client.Next();
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->image.pixels == rig.frames.At(0, {.sequence = 1}).pixels);
  EXPECT_FALSE(client.Next(200));
}

TEST(CameraControl, DeadCameraIsSilentUntilItIsRevived) {
  const ServedRig rig(82, 2);
  RawClient raw;
  rig.server->SetFaults(0, {.dead = true});
  EXPECT_FALSE(raw.ReadRegister(rig.addresses[0], kControl));
  EXPECT_EQ(raw.ReadRegister(rig.addresses[1], kControl), 0U);
  const std::vector<std::uint8_t> discovery = {0x42, 0x11, 0, 2, 0, 0, 0xFF, 0xFF};
  raw.Send(rig.addresses[0], 3956, discovery);
  EXPECT_TRUE(raw.Receive(200).empty());
  raw.Send(rig.addresses[1], 3956, discovery);
  EXPECT_EQ(raw.Receive(2000).size(), 8U + 0xF8U);
  rig.server->SetFaults(0, {});
  EXPECT_EQ(raw.ReadRegister(rig.addresses[0], kControl), 0U);
}

TEST(CameraControl, ImpossibleRigsAreRefused) {
  const ServedRig rig(82, 1);
  const ImageU8 image(16, 16);
  const FrameProvider provider = [&](int, const TriggerPulse&) -> const ImageU8& { return image; };
  const auto message_for = [&](const ServedCamera& camera,
                               const CameraServerOptions& options = {}) -> std::string {
    try {
      const CameraServer server({camera}, 0, provider, options);
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  const ServedCamera good{.serial = "OTHER", .address = "127.0.82.9", .width = 16, .height = 16};
  EXPECT_EQ(message_for(good), "accepted");
  ServedCamera bad = good;
  bad.address = rig.addresses[0];
  EXPECT_THAT(message_for(bad), HasSubstr("127.0.82.1:3956"));
  bad.address = "192.168.1.4";
  EXPECT_THAT(message_for(bad), HasSubstr("not a loopback address"));
  bad = good;
  bad.serial = "SIXTEEN-LETTERS!";
  EXPECT_THAT(message_for(bad), HasSubstr("SIXTEEN-LETTERS!"));
  EXPECT_THAT(message_for(good, {.faults = {{.packet_drop_probability = 1.0}}}),
              HasSubstr("packet_drop"));
  EXPECT_THROW(CameraServer({good, good}, 0, provider), Error);
  EXPECT_THROW(rig.server->SetFaults(1, {}), Error);
}

TEST(CameraControl, ProviderErrorsAreReportedAndLaterFramesGoOn) {
  const ImageU8 small(8, 8), good(16, 16, 9);
  const CameraServer server(
      {{.serial = "PROV", .address = "127.0.82.5", .width = 16, .height = 16, .exposure_us = 10}},
      0, [&](int, const TriggerPulse& pulse) -> const ImageU8& {
        return pulse.sequence == 1 ? small : good;
      });
  ArvClient client("127.0.82.5");
  client.Start("Software");
  arv_camera_software_trigger(client.Camera(), SOLE_ARV_OK);
  arv_camera_software_trigger(client.Camera(), SOLE_ARV_OK);
  const auto frame = client.Next();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->id, 1U);
  EXPECT_EQ(frame->image.At(3, 3), 9);
  EXPECT_THAT(server.Stats()[0].last_error, HasSubstr("8 x 8"));
}

}  // namespace
}  // namespace sole::sim
