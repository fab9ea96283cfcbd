// How frames travel: loss and resend, frame ids, region of interest, free run, pacing.
#include <chrono>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "sim/camera_server.h"
#include "tests/sim/gige_client.h"
#include "tests/sim/served_rig.h"

namespace sole::sim {
namespace {

/// Fires `count` pulses one after the other, each when the frame before has arrived.
std::vector<ReceivedFrame> Collect(const ServedRig& rig, ArvClient* client, int count) {
  const RawClient raw;
  std::vector<ReceivedFrame> frames;
  for (int sequence = 1; sequence <= count; ++sequence) {
    raw.Pulse(rig.server->BusPort(), {.sequence = sequence, .scheduled_ns = sequence, .kind = 0});
    auto frame = client->Next();
    if (!frame) break;
    frames.push_back(std::move(*frame));
  }
  return frames;
}

std::vector<std::uint64_t> Ids(const std::vector<ReceivedFrame>& frames) {
  std::vector<std::uint64_t> ids;
  for (const ReceivedFrame& frame : frames) ids.push_back(frame.id);
  return ids;
}

TEST(CameraStream, OnePercentLossIsRepairedByResend) {
  const ServedRig rig(81, 1, {.faults = {{.packet_drop_probability = 0.01}}});
  ArvClient client(rig.addresses[0]);
  client.Start("Line1", 576);
  constexpr int kFrames = 30;  // Of 143 payload packets.
  const std::vector<ReceivedFrame> frames = Collect(rig, &client, kFrames);
  ASSERT_EQ(frames.size(), kFrames);
  for (int i = 0; i < kFrames; ++i) {
    const ReceivedFrame& frame = frames[static_cast<std::size_t>(i)];
    EXPECT_EQ(frame.status, ARV_BUFFER_STATUS_SUCCESS) << "frame " << i;
    EXPECT_TRUE(frame.image.pixels == rig.frames.At(0, {.sequence = i + 1}).pixels)
        << "frame " << i;
  }
  const ServedCameraStats stats = rig.server->Stats()[0];
  EXPECT_GT(stats.packets_dropped, 10);
  EXPECT_GE(stats.resends_requested, stats.packets_dropped - 5);
  EXPECT_EQ(stats.resends_refused, 0);
  EXPECT_GT(arv_stream_get_info_uint64_by_name(client.Stream(), "n_resent_packets"), 10U);
}

TEST(CameraStream, FrameIdsWrapFrom65535To1) {
  const ServedRig rig(81, 1, {.first_frame_id = 65534});
  ArvClient client(rig.addresses[0]);
  client.Start("Line1");
  const std::vector<ReceivedFrame> frames = Collect(rig, &client, 4);
  EXPECT_EQ(Ids(frames), (std::vector<std::uint64_t>{65534, 65535, 1, 2}));
}

TEST(CameraStream, SkippedFrameIdLeavesAGapInIdsOnly) {
  const ServedRig rig(81, 1, {.faults = {{.skip_frame_id_after = 2}}});
  ArvClient client(rig.addresses[0]);
  client.Start("Line1");
  const std::vector<ReceivedFrame> frames = Collect(rig, &client, 4);
  EXPECT_EQ(Ids(frames), (std::vector<std::uint64_t>{1, 2, 4, 5}));
  EXPECT_EQ(frames[3].timestamp_ns, 4U);
}

TEST(CameraStream, RegionOfInterestIsCutFromTheProvidedImage) {
  const ServedRig rig(81, 1);
  ArvClient client(rig.addresses[0]);
  arv_camera_set_region(client.Camera(), 17, 33, 101, 55, SOLE_ARV_OK);
  client.Start("Line1", 1500);
  const std::vector<ReceivedFrame> frames = Collect(rig, &client, 1);
  ASSERT_EQ(frames.size(), 1U);
  const ImageU8 &got = frames[0].image, &whole = rig.frames.At(0, {.sequence = 1});
  ASSERT_EQ(got.width, 101);
  ASSERT_EQ(got.height, 55);
  for (int y = 0; y < got.height; ++y) {
    for (int x = 0; x < got.width; ++x)
      ASSERT_EQ(got.At(x, y), whole.At(x + 17, y + 33)) << x << "," << y;
  }
  // Formats stay as they are while frames flow.
  GError* error = nullptr;
  arv_device_write_register(client.Device(), 0x10000, 64, &error);
  EXPECT_NE(error, nullptr);
  g_clear_error(&error);
}

TEST(CameraStream, FreeRunKeepsItsRateAndSingleFrameStops) {
  const ServedRig rig(81, 1);
  ArvClient client(rig.addresses[0]);
  arv_camera_set_frame_rate(client.Camera(), 50, SOLE_ARV_OK);
  client.Start("");
  std::vector<ReceivedFrame> frames;
  for (int i = 0; i < 6; ++i) {
    auto frame = client.Next();
    ASSERT_TRUE(frame);
    frames.push_back(std::move(*frame));
  }
  for (std::size_t i = 1; i < frames.size(); ++i) {
    const double periods =
        5e-8 * static_cast<double>(frames[i].timestamp_ns - frames[i - 1].timestamp_ns);
    EXPECT_GT(periods, 0.95) << "never faster than asked";
  }
  EXPECT_TRUE(frames[5].image.pixels ==
              rig.frames.At(0, {.sequence = static_cast<std::int64_t>(frames[5].id)}).pixels);

  client.Stop();
  arv_camera_set_acquisition_mode(client.Camera(), ARV_ACQUISITION_MODE_SINGLE_FRAME, SOLE_ARV_OK);
  client.Start("");
  const auto only = client.Next();
  ASSERT_TRUE(only);
  EXPECT_EQ(only->id, 1U) << "a reopened stream counts from 1";
  EXPECT_FALSE(client.Next(200));
}

TEST(CameraStream, PacketDelayIsHonoured) {
  const ServedRig rig(81, 1);
  ArvClient client(rig.addresses[0]);
  constexpr int kDelayNs = 1000000;
  arv_camera_gv_set_packet_delay(client.Camera(), kDelayNs, SOLE_ARV_OK);
  client.Start("Line1", 1500);
  const auto begin = std::chrono::steady_clock::now();
  const std::vector<ReceivedFrame> frames = Collect(rig, &client, 1);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(frames[0].status, ARV_BUFFER_STATUS_SUCCESS);
  const int payload_packets = (kWidth * kHeight + 1463) / 1464;
  EXPECT_GE(took.count(), 1e-9 * kDelayNs * payload_packets);
}

TEST(CameraStream, TestPacketsFindTheLargestPacket) {
  const ServedRig rig(81, 1);
  const ArvClient client(rig.addresses[0]);
  // Aravis halves the interval between a size that came through and the limit of 65500.
  const unsigned size = arv_gv_device_auto_packet_size(ARV_GV_DEVICE(client.Device()), SOLE_ARV_OK);
  EXPECT_GE(size, 65490U);
  EXPECT_EQ(arv_camera_gv_get_packet_size(client.Camera(), SOLE_ARV_OK), size);
}

TEST(CameraStream, PacketsOutsideTheRingAreUnavailable) {
  const ServedRig rig(81, 1);
  const std::string& address = rig.addresses[0];
  RawClient raw, stream;
  ASSERT_EQ(raw.WriteRegister(address, 0xA00, 2), 0);
  ASSERT_EQ(raw.WriteRegister(address, 0xD18, 0x7F000001), 0);
  ASSERT_EQ(raw.WriteRegister(address, 0xD00, static_cast<std::uint32_t>(stream.Port())), 0);
  ASSERT_EQ(raw.WriteRegister(address, 0xD04, 60000), 0);
  ASSERT_EQ(raw.WriteRegister(address, 0x10204, 1), 0);
  ASSERT_EQ(raw.WriteRegister(address, 0x10104, 1), 0);
  constexpr int kFrames = 9, kPacketsPerFrame = 4;
  for (int frame = 1; frame <= kFrames; ++frame) {
    raw.Pulse(rig.server->BusPort(), {.sequence = frame, .scheduled_ns = 1, .kind = 0});
    for (int i = 0; i < kPacketsPerFrame; ++i) ASSERT_GE(stream.Receive(2000).size(), 16U);
  }
  const auto status_of = [&](std::uint8_t frame, std::uint8_t packet) {
    const std::vector<std::uint8_t> request = {0x42, 0,     0, 0x40, 0, 12,     0, 1, 0, 0,
                                               0,    frame, 0, 0,    0, packet, 0, 0, 0, packet};
    stream.Send(address, 3956, request);
    const std::vector<std::uint8_t> answer = stream.Receive(2000);
    if (answer.size() < 8 || answer[3] != frame || answer[7] != packet) return -1;
    return answer[0] << 8 | answer[1];
  };
  EXPECT_EQ(status_of(9, 1), 0x0100) << "resent";
  EXPECT_EQ(status_of(2, 3), 0x0100) << "the oldest of 8, its trailer";
  EXPECT_EQ(status_of(1, 1), 0x800C) << "nine frames ago";
  EXPECT_EQ(rig.server->Stats()[0].resends_refused, 1);
}

}  // namespace
}  // namespace sole::sim
