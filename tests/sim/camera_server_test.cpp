#include "sim/camera_server.h"

#include <array>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <set>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/sim/gige_client.h"
#include "tests/sim/served_rig.h"

namespace sole::sim {
namespace {

using testing::HasSubstr;

TEST(CameraServer, IsDiscoveredByStockClient) {
  const ServedRig rig(71, 2);
  const ServedRig other(76, 1);  // Two servers share the broadcasts.
  arv_update_device_list();
  std::map<std::string, std::string> address_of;
  std::map<std::string, std::string> id_of;
  std::set<std::string> physical;
  for (unsigned i = 0; i < arv_get_n_devices(); ++i) {
    const std::string serial = arv_get_device_serial_nbr(i);
    if (!serial.starts_with("SRV71") && !serial.starts_with("SRV76")) continue;
    address_of[serial] = arv_get_device_address(i);
    id_of[serial] = arv_get_device_id(i);
    physical.insert(arv_get_device_physical_id(i));
    EXPECT_STREQ(arv_get_device_vendor(i), "Sole");
    EXPECT_STREQ(arv_get_device_model(i), "SimulatedCamera");
  }
  const std::map<std::string, std::string> expected = {
      {"SRV71A", "127.0.71.1"}, {"SRV71B", "127.0.71.2"}, {"SRV76A", "127.0.76.1"}};
  EXPECT_EQ(address_of, expected);
  EXPECT_EQ(physical.size(), 3U);

  const ArvClient client(id_of["SRV71B"]);
  ASSERT_NE(client.Camera(), nullptr);
  EXPECT_STREQ(arv_camera_get_device_serial_number(client.Camera(), SOLE_ARV_OK), "SRV71B");
}

TEST(CameraServer, IsListedByArvTool) {
  if (std::system("command -v arv-tool-0.8 > /dev/null") != 0)
    GTEST_SKIP() << "arv-tool-0.8 is not installed";
  const ServedRig rig(72, 20);
  FILE* pipe = popen("arv-tool-0.8 2>&1", "r");
  ASSERT_NE(pipe, nullptr);
  std::string output;
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), static_cast<int>(buffer.size()), pipe) != nullptr)
    output += buffer.data();
  EXPECT_EQ(pclose(pipe), 0);
  for (std::size_t i = 0; i < rig.serials.size(); ++i) {
    EXPECT_THAT(output, HasSubstr("Sole-SimulatedCamera-" + rig.serials[i] + " (" +
                                  rig.addresses[i] + ")"));
  }
}

TEST(CameraServer, FeaturesReadBackWhatWasWritten) {
  const ServedRig rig(73, 1);
  const ArvClient client(rig.addresses[0]);
  ArvCamera* camera = client.Camera();
  ASSERT_NE(camera, nullptr);
  int width = 0, height = 0, x = 0, y = 0;
  arv_camera_get_sensor_size(camera, &width, &height, SOLE_ARV_OK);
  EXPECT_EQ(width, kWidth);
  EXPECT_EQ(height, kHeight);
  EXPECT_EQ(arv_camera_get_exposure_time(camera, SOLE_ARV_OK), 100);
  arv_camera_set_exposure_time(camera, 1234.5, SOLE_ARV_OK);
  EXPECT_EQ(arv_camera_get_exposure_time(camera, SOLE_ARV_OK), 1234.5);
  double low = 0, high = 0;
  arv_camera_get_exposure_time_bounds(camera, &low, &high, SOLE_ARV_OK);
  EXPECT_EQ(low, 10);
  EXPECT_EQ(high, 1e6);
  arv_camera_set_gain(camera, 6.25, SOLE_ARV_OK);
  EXPECT_EQ(arv_camera_get_gain(camera, SOLE_ARV_OK), 6.25);
  arv_camera_set_frame_rate(camera, 25, SOLE_ARV_OK);
  EXPECT_EQ(arv_camera_get_frame_rate(camera, SOLE_ARV_OK), 25);
  arv_camera_set_trigger(camera, "Line1", SOLE_ARV_OK);
  EXPECT_STREQ(arv_camera_get_trigger_source(camera, SOLE_ARV_OK), "Line1");
  EXPECT_STREQ(arv_camera_get_string(camera, "TriggerMode", SOLE_ARV_OK), "On");
  EXPECT_STREQ(arv_camera_get_pixel_format_as_string(camera, SOLE_ARV_OK), "Mono8");
  arv_camera_set_region(camera, 16, 8, 200, 100, SOLE_ARV_OK);
  arv_camera_get_region(camera, &x, &y, &width, &height, SOLE_ARV_OK);
  EXPECT_EQ((std::array{x, y, width, height}), (std::array{16, 8, 200, 100}));
  EXPECT_EQ(arv_camera_get_payload(camera, SOLE_ARV_OK), 200U * 100U);
  arv_camera_gv_set_packet_delay(camera, 5000, SOLE_ARV_OK);
  EXPECT_EQ(arv_camera_gv_get_packet_delay(camera, SOLE_ARV_OK), 5000);
  arv_camera_gv_set_packet_size(camera, 9000, SOLE_ARV_OK);
  EXPECT_EQ(arv_camera_gv_get_packet_size(camera, SOLE_ARV_OK), 9000U);
  arv_camera_set_string(camera, "DeviceUserID", "toe left", SOLE_ARV_OK);
  EXPECT_STREQ(arv_camera_get_string(camera, "DeviceUserID", SOLE_ARV_OK), "toe left");
  arv_camera_set_string(camera, "LineSelector", "Line2", SOLE_ARV_OK);
  EXPECT_STREQ(arv_camera_get_string(camera, "LineMode", SOLE_ARV_OK), "Output");
  EXPECT_FALSE(arv_camera_get_boolean(camera, "LineStatus", SOLE_ARV_OK));

  EXPECT_EQ(arv_camera_get_integer(camera, "GevTimestampTickFrequency", SOLE_ARV_OK), 1000000000);
  const std::int64_t before = NowNs();
  arv_camera_execute_command(camera, "GevTimestampControlLatch", SOLE_ARV_OK);
  const std::int64_t latched = arv_camera_get_integer(camera, "GevTimestampValue", SOLE_ARV_OK);
  EXPECT_GE(latched, before);
  EXPECT_LE(latched, NowNs());
}

TEST(CameraServer, ImpossibleValuesAreRefused) {
  const ServedRig rig(73, 1);
  RawClient raw;
  const std::string& camera = rig.addresses[0];
  EXPECT_EQ(raw.WriteRegister(camera, 0x10000, 100), 0x8006) << "control comes first";
  EXPECT_EQ(raw.WriteRegister(camera, 0xA00, 2), 0);
  EXPECT_EQ(raw.WriteRegister(camera, 0x10000, 100), 0);
  EXPECT_EQ(raw.WriteRegister(camera, 0x10000, kWidth + 1), 0x8002);
  EXPECT_EQ(raw.WriteRegister(camera, 0x10008, kWidth - 99), 0x8002)
      << "the region would leave the sensor";
  EXPECT_EQ(raw.WriteRegister(camera, 0x10204, 7), 0x8002) << "no such trigger mode";
  EXPECT_EQ(raw.WriteRegister(camera, 0x10010, 100), 0x8004) << "sensor width";
  EXPECT_EQ(raw.WriteRegister(camera, 0x10002, 100), 0x8005);
  EXPECT_EQ(raw.WriteRegister(camera, 0x20000, 100), 0x8003);
  EXPECT_EQ(raw.WriteRegister(camera, 0x100000, 0), 0x8004) << "the XML";
  EXPECT_EQ(raw.ReadRegister(camera, 0x10000), 100U);
}

TEST(CameraServer, SoftwareTriggerDeliversTheProvidedFrames) {
  const ServedRig rig(74, 1);
  ArvClient client(rig.addresses[0]);
  client.Start("Software");
  std::uint64_t last_ns = static_cast<std::uint64_t>(NowNs());
  for (int sequence = 1; sequence <= 5; ++sequence) {
    arv_camera_software_trigger(client.Camera(), SOLE_ARV_OK);
    const auto frame = client.Next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->status, ARV_BUFFER_STATUS_SUCCESS);
    EXPECT_EQ(frame->id, static_cast<std::uint64_t>(sequence));
    EXPECT_EQ(frame->image.pixels, rig.frames.At(0, {.sequence = sequence}).pixels);
    EXPECT_GT(frame->timestamp_ns, last_ns);
    EXPECT_LE(frame->timestamp_ns, static_cast<std::uint64_t>(NowNs()));
    last_ns = frame->timestamp_ns;
  }
  const RawClient raw;
  raw.Pulse(rig.server->BusPort(), {.sequence = 1, .scheduled_ns = 1, .kind = 0});
  EXPECT_FALSE(client.Next(200))
      << "a line pulse must not trigger a camera that waits for software";
}

TEST(CameraServer, BusPulsesTriggerEveryArmedCameraInOrder) {
  const ServedRig rig(75, 3);
  ArvClient first(rig.addresses[0]), second(rig.addresses[1]), idle(rig.addresses[2]);
  first.Start("Line1");
  second.Start("Line1", 1500);
  idle.Start("Software");
  const RawClient raw;
  constexpr std::int64_t kStart = 1700000000123456789;
  const auto pulse_at = [](std::int64_t sequence) -> TriggerPulse {
    return {.sequence = sequence,
            .scheduled_ns = kStart + sequence * 100000007,
            .kind = sequence % 2 == 0 ? 1U : 0U};
  };
  const auto expect_frame = [&](int camera, ArvClient* client, std::int64_t sequence) {
    const auto frame = client->Next();
    ASSERT_TRUE(frame) << "camera " << camera << " sequence " << sequence;
    EXPECT_EQ(frame->status, ARV_BUFFER_STATUS_SUCCESS);
    EXPECT_EQ(frame->id, static_cast<std::uint64_t>(sequence + 2));
    EXPECT_EQ(frame->timestamp_ns, static_cast<std::uint64_t>(pulse_at(sequence).scheduled_ns));
    EXPECT_TRUE(frame->image.pixels == rig.frames.At(camera, pulse_at(sequence)).pixels)
        << "camera " << camera << " sequence " << sequence;
  };
  // Aravis enlarges its receive buffer when the first frame arrives: warm up, as a recorder does.
  for (std::int64_t sequence = -1; sequence <= 0; ++sequence) {
    raw.Pulse(rig.server->BusPort(), pulse_at(sequence));
    expect_frame(0, &first, sequence);
    expect_frame(1, &second, sequence);
  }
  // Faster than frames leave: pending pulses are queued, not overwritten.
  for (std::int64_t sequence = 1; sequence <= 8; ++sequence) {
    raw.Pulse(rig.server->BusPort(), pulse_at(sequence));
  }
  for (std::int64_t sequence = 1; sequence <= 8; ++sequence) {
    expect_frame(0, &first, sequence);
    expect_frame(1, &second, sequence);
  }
  EXPECT_FALSE(idle.Next(100));
  const auto stats = rig.server->Stats();
  EXPECT_EQ(stats[0].frames_sent, 10);
  EXPECT_EQ(stats[1].serial, "SRV75B");
  EXPECT_EQ(stats[2].triggers, 0);
}

}  // namespace
}  // namespace sole::sim
