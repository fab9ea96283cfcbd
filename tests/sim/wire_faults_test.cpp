// Faults that show on the wire, each by its name, as a stock client meets them.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <thread>
#include <vector>

#include "sim/camera_server.h"
#include "tests/sim/gige_client.h"
#include "tests/sim/served_rig.h"

namespace sole::sim {
namespace {

/// Two cameras, the faults on the first.
ServedRig RigWith(int net, std::vector<FaultConfig> faults) {
  for (FaultConfig& fault : faults) fault.camera = "SRV" + std::to_string(net) + "A";
  return {net, 2, {.schedule = std::move(faults)}};
}

constexpr std::int64_t kStart = 1700000000000000000;

TriggerPulse PulseAt(std::int64_t sequence) {
  return {.sequence = sequence, .scheduled_ns = kStart + sequence * 100000000, .kind = 0};
}

void Fire(const ServedRig& rig, std::int64_t sequence) {
  RawClient().Pulse(rig.server->BusPort(), PulseAt(sequence));
}

/// A warmed-up client of camera `camera`; its warm-up frame had id 1.
struct Receiver {
  Receiver(const ServedRig& rig, std::size_t camera, int packet_size = 9000)
      : client(rig.addresses[camera]) {
    client.Start("Line1", packet_size);
    Fire(rig, 0);
    EXPECT_TRUE(client.Next());
  }
  /// Fires a pulse for each of `ids`, from `first` on: it must bring a frame of that id, or none
  /// where the id is 0.
  void Expect(const ServedRig& rig, std::int64_t first, const std::vector<std::uint64_t>& ids) {
    std::vector<std::uint64_t> got;
    for (const std::uint64_t id : ids) {
      Fire(rig, first + static_cast<std::int64_t>(got.size()));
      const auto frame = client.Next(id == 0 ? 200 : 5000);
      got.push_back(frame ? frame->id : 0);
    }
    EXPECT_EQ(got, ids);
  }
  ArvClient client;
};

TEST(WireFaults, LostPacketsAreAskedForAgain) {
  const ServedRig rig = RigWith(104, {MakeFault("lost-packets", "", 0.02, "", 3)});
  Receiver receiver(rig, 0, 576);
  receiver.Expect(rig, 1, {2, 3});
  EXPECT_EQ(rig.server->Stats()[0].packets_dropped, 0) << "not before its trigger";
  for (std::int64_t sequence = 3; sequence <= 12; ++sequence) {
    Fire(rig, sequence);
    const auto frame = receiver.client.Next();
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->status, ARV_BUFFER_STATUS_SUCCESS);
    EXPECT_TRUE(frame->image.pixels == rig.frames.At(0, PulseAt(sequence)).pixels);
  }
  EXPECT_GT(rig.server->Stats()[0].packets_dropped, 5);
  EXPECT_GT(arv_stream_get_info_uint64_by_name(receiver.client.Stream(), "n_resent_packets"), 5U);
}

TEST(WireFaults, LateFramesComeLateWithTheRightTimestamp) {
  const ServedRig rig = RigWith(104, {MakeFault("late-frames", "", 300)});
  Receiver receiver(rig, 0);
  const auto begin = std::chrono::steady_clock::now();
  Fire(rig, 1);
  const auto frame = receiver.client.Next();
  EXPECT_GE(std::chrono::steady_clock::now() - begin, std::chrono::milliseconds(295));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->timestamp_ns, static_cast<std::uint64_t>(PulseAt(1).scheduled_ns));
}

TEST(WireFaults, SkippedIdLeavesAGap) {
  const ServedRig rig = RigWith(104, {MakeFault("skipped-id", "", 2)});
  Receiver faulty(rig, 0);
  faulty.Expect(rig, 1, {2, 3, 6, 7});
}

TEST(WireFaults, RepeatedIdIsOnTheWireTwiceAndTheStockClientDropsTheFrame) {
  const ServedRig rig = RigWith(105, {MakeFault("repeated-id")});
  {
    Receiver faulty(rig, 0);
    faulty.Expect(rig, 1, {2, 3, 0, 4});
  }
  RawClient raw, stream;
  const std::string& address = rig.addresses[0];
  ASSERT_EQ(raw.WriteRegister(address, 0xA00, 2), 0);
  ASSERT_EQ(raw.WriteRegister(address, 0xD18, 0x7F000001), 0);
  ASSERT_EQ(raw.WriteRegister(address, 0xD00, static_cast<std::uint32_t>(stream.Port())), 0);
  ASSERT_EQ(raw.WriteRegister(address, 0xD04, 60000), 0);
  ASSERT_EQ(raw.WriteRegister(address, 0x10204, 1), 0);
  ASSERT_EQ(raw.WriteRegister(address, 0x10104, 1), 0);
  std::vector<int> leaders;
  for (std::int64_t sequence = 1; sequence <= 4; ++sequence) {
    Fire(rig, sequence);
    for (int packet = 0; packet < 4; ++packet) {
      const std::vector<std::uint8_t> bytes = stream.Receive(2000);
      ASSERT_GE(bytes.size(), 8U);
      if (bytes[4] == 1) leaders.push_back(bytes[3]);
    }
  }
  EXPECT_EQ(leaders, (std::vector<int>{1, 2, 2, 3}));
}

TEST(WireFaults, DeadLinkLosesFramesForItsTimeWhileTheCameraCountsOn) {
  const ServedRig rig = RigWith(106, {MakeFault("dead-link", "", 2, "", 2)});
  Receiver faulty(rig, 0);
  arv_camera_set_integer(faulty.client.Camera(), "GevHeartbeatTimeout", 60000, SOLE_ARV_OK);
  faulty.Expect(rig, 1, {2, 0, 0});
  RawClient raw;
  EXPECT_FALSE(raw.ReadRegister(rig.addresses[0], 0xA00)) << "no answer to anything";
  EXPECT_TRUE(raw.ReadRegister(rig.addresses[1], 0xA00)) << "the other camera is well";
  for (int i = 0; i < 40 && !raw.ReadRegister(rig.addresses[0], 0xA00);) ++i;
  faulty.Expect(rig, 4, {5});
}

TEST(WireFaults, RebootLosesControlAndSettingsUntilTheCameraIsOpenedAgain) {
  const ServedRig rig = RigWith(107, {MakeFault("reboot", "", 1.5, "", 2)});
  RawClient raw;
  {
    Receiver faulty(rig, 0);
    arv_camera_set_exposure_time(faulty.client.Camera(), 777, SOLE_ARV_OK);
    faulty.Expect(rig, 1, {2, 0});
    EXPECT_FALSE(raw.ReadRegister(rig.addresses[0], 0xA00)) << "starting up";
    for (int i = 0; i < 40 && !raw.ReadRegister(rig.addresses[0], 0xA00);) ++i;
    EXPECT_EQ(raw.ReadRegister(rig.addresses[0], 0xA00), 0U) << "nobody has control";
    faulty.Expect(rig, 3, {0});
    GError* error = nullptr;
    arv_camera_set_exposure_time(faulty.client.Camera(), 777, &error);
    EXPECT_NE(error, nullptr);
    g_clear_error(&error);
    arv_camera_stop_acquisition(faulty.client.Camera(), &error);
    g_clear_error(&error);
  }
  Receiver again(rig, 0);
  EXPECT_EQ(arv_camera_get_exposure_time(again.client.Camera(), SOLE_ARV_OK), 100);
  again.Expect(rig, 4, {2, 3});
}

TEST(WireFaults, DesyncShowsTheFrameBeforeUnderTheRightIdAndTime) {
  const ServedRig rig = RigWith(108, {MakeFault("desync", "", 1, "", 2)});
  ArvClient client(rig.addresses[0]);
  arv_camera_set_chunks(client.Camera(), "TriggerSequence", SOLE_ARV_OK);
  ArvChunkParser* parser = arv_camera_create_chunk_parser(client.Camera());
  client.Start("Line1");
  for (std::int64_t sequence = 0; sequence <= 4; ++sequence) {
    Fire(rig, sequence);
    ArvBuffer* buffer = arv_stream_timeout_pop_buffer(client.Stream(), 5000000);
    ASSERT_NE(buffer, nullptr);
    ASSERT_EQ(arv_buffer_get_status(buffer), ARV_BUFFER_STATUS_SUCCESS);
    const std::int64_t shown = sequence < 2 ? sequence : sequence - 1;
    EXPECT_EQ(arv_buffer_get_frame_id(buffer), static_cast<std::uint64_t>(sequence + 1));
    EXPECT_EQ(arv_buffer_get_timestamp(buffer),
              static_cast<std::uint64_t>(PulseAt(sequence).scheduled_ns));
    EXPECT_EQ(
        arv_chunk_parser_get_integer_value(parser, buffer, "ChunkTriggerSequence", SOLE_ARV_OK),
        shown);
    const ImageU8& expected = rig.frames.At(0, PulseAt(shown));
    EXPECT_TRUE(std::equal(expected.pixels.begin(), expected.pixels.end(),
                           static_cast<const std::uint8_t*>(arv_buffer_get_data(buffer, nullptr))));
    arv_stream_push_buffer(client.Stream(), buffer);
  }
  g_object_unref(parser);
}

TEST(WireFaults, ClockDriftGrowsUntilPtpIsEnabled) {
  const ServedRig rig = RigWith(109, {MakeFault("clock-drift", "", 50000)});
  Receiver faulty(rig, 0), good(rig, 1);
  const auto now_pulse = [&](std::int64_t sequence) {
    const std::int64_t now = NowNs();
    RawClient().Pulse(rig.server->BusPort(), {.sequence = sequence, .scheduled_ns = now});
    const auto bad_frame = faulty.client.Next(), good_frame = good.client.Next();
    if (!bad_frame || !good_frame) return std::int64_t{-1};
    EXPECT_EQ(static_cast<std::int64_t>(good_frame->timestamp_ns), now);
    return static_cast<std::int64_t>(bad_frame->timestamp_ns) - now;
  };
  ASSERT_TRUE(faulty.client.Next()) << "the second warm-up";
  now_pulse(1);
  const std::int64_t begin = NowNs(), first = now_pulse(2);
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  const std::int64_t last = now_pulse(3);
  const double passed = static_cast<double>(NowNs() - begin);
  EXPECT_GE(last - first, 0.05 * 0.4e9);
  EXPECT_LE(static_cast<double>(last - first), 0.05 * passed);
  arv_camera_set_boolean(faulty.client.Camera(), "GevIEEE1588", TRUE, SOLE_ARV_OK);
  std::this_thread::sleep_for(std::chrono::milliseconds(2000));
  EXPECT_LT(std::abs(now_pulse(4)), 1000);
}

TEST(WireFaults, MissingTriggerLeavesNoFrameAndNoGapInIds) {
  const ServedRig rig = RigWith(110, {MakeFault("missing-trigger", "", 2, "", 2)});
  Receiver faulty(rig, 0);
  faulty.Expect(rig, 1, {2, 0, 0, 3, 4});
  EXPECT_EQ(rig.server->Stats()[0].triggers, 4);
}

TEST(WireFaults, DoubleTriggerBringsTwoFramesAndShiftsLaterIds) {
  const ServedRig rig = RigWith(110, {MakeFault("double-trigger", "", 20, "", 2)});
  Receiver faulty(rig, 0);
  Fire(rig, 2);
  const auto first = faulty.client.Next(), second = faulty.client.Next();
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->id, 2U);
  EXPECT_EQ(second->id, 3U);
  EXPECT_EQ(second->timestamp_ns - first->timestamp_ns, 20000000U);
  EXPECT_TRUE(first->image.pixels == second->image.pixels);
  faulty.Expect(rig, 3, {4});
}

TEST(WireFaults, WithoutACameraEveryCameraSuffers) {
  const ServedRig rig(111, 2, {.schedule = {MakeFault("missing-trigger", "", 1, "", 1)}});
  ArvClient a(rig.addresses[0]), b(rig.addresses[1]);
  a.Start("Line1");
  b.Start("Line1");
  Fire(rig, 0);
  Fire(rig, 1);
  for (ArvClient* client : {&a, &b}) {
    EXPECT_TRUE(client->Next());
    EXPECT_FALSE(client->Next(200));
  }
}

}  // namespace
}  // namespace sole::sim
