// Malformed and random packets on a camera's control port and on the trigger bus: nothing crashes,
// hangs or leaves the camera in a state that its registers do not allow.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "sim/camera_server.h"
#include "tests/sim/gige_client.h"
#include "tests/sim/served_rig.h"

namespace sole::sim {
namespace {

using Bytes = std::vector<std::uint8_t>;

constexpr int kGvcpPort = 3956;
constexpr std::uint32_t kControl = 0xA00;

class PacketFuzzer {
 public:
  explicit PacketFuzzer(std::uint64_t seed) : random_(seed) {}

  /// A command as a client might send it, then possibly damaged.
  Bytes Next() {
    Bytes packet = Command();
    for (std::uint32_t i = Below(4); i > 0; --i) Damage(packet);
    return packet;
  }

 private:
  std::uint32_t Below(std::uint32_t n) { return static_cast<std::uint32_t>(random_() % n); }
  std::uint8_t Byte() { return static_cast<std::uint8_t>(Below(256)); }
  void Push16(Bytes& bytes, std::uint32_t value) {
    bytes.push_back(static_cast<std::uint8_t>(value >> 8));
    bytes.push_back(static_cast<std::uint8_t>(value));
  }
  void Push32(Bytes& bytes, std::uint32_t value) {
    Push16(bytes, value >> 16);
    Push16(bytes, value & 0xFFFF);
  }
  /// Registers of every kind, their neighbours, the ends of the address space.
  std::uint32_t Address() {
    static constexpr std::uint32_t kPlaces[] = {
        0,       0x8,     0xD8,    0xE8,    0x200,   0x938,    0xA00,      0xD00,
        0xD04,   0xD08,   0xD18,   0x9800,  0x10000, 0x10008,  0x10018,    0x10100,
        0x10104, 0x10110, 0x10204, 0x10208, 0x10210, 0x10308,  0x10400,    0x10600,
        0x10700, 0x10704, 0x10FFC, 0x11000, 0xFFFFC, 0x100000, 0x7FFFFFF0, 0xFFFFFFF8};
    const std::uint32_t place = kPlaces[Below(std::size(kPlaces))];
    return Below(8) == 0 ? static_cast<std::uint32_t>(random_()) : place + Below(4) * 4;
  }
  std::uint32_t Value() {
    static constexpr std::uint32_t kValues[] = {
        0,      1,          2,          3,    4,    100,    320,        576,       65500,
        0x8000, 0xC0000FA0, 0x7F000001, 9000, 5555, 0xFFFF, 0x7FF00000, 0xFFFFFFFF};
    return Below(4) == 0 ? static_cast<std::uint32_t>(random_())
                         : kValues[Below(std::size(kValues))];
  }
  Bytes Command() {
    static constexpr std::uint16_t kCommands[] = {0x02, 0x40,  0x80, 0x82,  0x84,
                                                  0x86, 0x100, 0x04, 0xFFFF};
    const std::uint16_t command = kCommands[Below(std::size(kCommands))];
    Bytes data;
    switch (command) {
      case 0x80:  // read registers
        for (std::uint32_t i = Below(5); i > 0; --i) Push32(data, Address());
        break;
      case 0x82:  // write registers
        for (std::uint32_t i = Below(5); i > 0; --i) {
          Push32(data, Address());
          Push32(data, Value());
        }
        break;
      case 0x84:  // read memory
        Push32(data, Address());
        Push32(data, Below(2) == 0 ? Below(600) : Value());
        break;
      case 0x86:  // write memory
        Push32(data, Address());
        for (std::uint32_t i = Below(6); i > 0; --i) Push32(data, Value());
        break;
      case 0x40:  // resend
        Push32(data, Below(12));
        Push32(data, Below(2) == 0 ? Below(200) : Value());
        Push32(data, Below(2) == 0 ? Below(200) : Value());
        break;
      default:
        for (std::uint32_t i = Below(5); i > 0; --i) Push32(data, Value());
        break;
    }
    Bytes packet = {0x42, static_cast<std::uint8_t>(Below(4) == 0 ? Byte() : 1)};
    Push16(packet, command);
    Push16(packet, static_cast<std::uint32_t>(data.size()));
    Push16(packet, 1 + Below(65535));
    packet.insert(packet.end(), data.begin(), data.end());
    return packet;
  }
  void Damage(Bytes& packet) {
    switch (Below(5)) {
      case 0:
        packet.resize(Below(static_cast<std::uint32_t>(packet.size()) + 1));
        break;
      case 1:
        for (std::uint32_t i = Below(600); i > 0; --i) packet.push_back(Byte());
        break;
      case 2:
        if (packet.size() > 5) packet[4 + Below(2)] = Byte();  // the length it claims
        break;
      default:
        if (!packet.empty()) packet[Below(static_cast<std::uint32_t>(packet.size()))] = Byte();
        break;
    }
  }

  std::mt19937_64 random_;
};

/// What a healthy answer looks like: a header that tells its own length and an odd command.
void ExpectWellFormed(const Bytes& answer) {
  ASSERT_GE(answer.size(), 8U);
  EXPECT_EQ(answer.size(), 8U + static_cast<unsigned>(answer[4] << 8 | answer[5]));
  EXPECT_EQ(answer[3] & 1, 1);
  EXPECT_TRUE(answer[6] != 0 || answer[7] != 0) << "the id of the question, never 0";
}

TEST(CameraFuzz, RandomPacketsLeaveACameraThatWorks) {
  const ServedRig rig(115, 2);
  const std::string& address = rig.addresses[0];
  ArvClient neighbour(rig.addresses[1]);
  neighbour.Start("Line1");
  RawClient fuzz;
  PacketFuzzer fuzzer(7);
  std::mt19937_64 random(8);
  constexpr int kRounds = 150, kPacketsPerRound = 100;
  int answers = 0, granted = 0;
  for (int round = 1; round <= kRounds; ++round) {
    // With control, so that writes go deep; it may have been lost to a random write.
    granted += fuzz.WriteRegister(address, kControl, 2) == 0;
    for (int i = 0; i < kPacketsPerRound; ++i) {
      const Bytes packet = fuzzer.Next();
      fuzz.Send(address, kGvcpPort, packet);
      Bytes pulse(random() % 40);
      std::generate(pulse.begin(), pulse.end(),
                    [&] { return static_cast<std::uint8_t>(random()); });
      fuzz.Send("127.0.0.1", rig.server->BusPort(), pulse);
    }
    for (Bytes answer = fuzz.Receive(20); !answer.empty(); answer = fuzz.Receive(5)) {
      ExpectWellFormed(answer);
      ++answers;
    }
    const auto value = [&](std::uint32_t where) {
      const auto read = fuzz.ReadRegister(address, where);
      EXPECT_TRUE(read) << "round " << round;
      return read.value_or(0);
    };
    EXPECT_LE(value(0x10000) + value(0x10008), static_cast<unsigned>(kWidth)) << "round " << round;
    EXPECT_LE(value(0x10004) + value(0x1000C), static_cast<unsigned>(kHeight)) << "round " << round;
    EXPECT_GE(value(0x10000), 4U);
    EXPECT_GE(value(0xD04) & 0xFFFF, 576U);
    EXPECT_LE(value(0xD04) & 0xFFFF, 65500U);
    EXPECT_LE(value(0xA00), 3U);
    ASSERT_FALSE(HasFailure()) << "round " << round;
  }
  EXPECT_GT(granted, kRounds / 2);
  EXPECT_GT(answers, kRounds * 20);

  RawClient().Pulse(rig.server->BusPort(), {.sequence = 1, .scheduled_ns = 5});
  const auto frame = neighbour.Next();
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->image.pixels == rig.frames.At(1, {.sequence = 1}).pixels);
  ASSERT_EQ(fuzz.WriteRegister(address, kControl, 0), 0);
  ArvClient client(address);
  ASSERT_NE(client.Camera(), nullptr);
  arv_camera_set_region(client.Camera(), 0, 0, kWidth, kHeight, SOLE_ARV_OK);
}

TEST(CameraFuzz, ABlockThatMovesTheRegionOffTheSensorIsRefusedWhole) {
  const ServedRig rig(115, 1);
  RawClient raw;
  ASSERT_EQ(raw.WriteRegister(rig.addresses[0], kControl, 2), 0);
  ASSERT_EQ(raw.WriteRegister(rig.addresses[0], 0x10000, 4), 0);
  // WRITEMEM of width, height and offsets, each of them possible beside the old values.
  Bytes packet = {0x42, 1, 0, 0x86, 0, 20, 0, 9, 0, 1, 0, 0};
  for (const std::uint32_t value : {300U, 200U, 316U, 0U}) {
    for (const int shift : {24, 16, 8, 0})
      packet.push_back(static_cast<std::uint8_t>(value >> shift));
  }
  raw.Send(rig.addresses[0], kGvcpPort, packet);
  const Bytes answer = raw.Receive(2000);
  ASSERT_GE(answer.size(), 8U);
  EXPECT_EQ(answer[0] << 8 | answer[1], 0x8002);
  EXPECT_EQ(raw.ReadRegister(rig.addresses[0], 0x10000), 4U);
  packet[12 + 3] = 4, packet[12 + 2] = 0;  // now it fits
  raw.Send(rig.addresses[0], kGvcpPort, packet);
  ASSERT_GE(raw.Receive(2000).size(), 8U);
  EXPECT_EQ(raw.ReadRegister(rig.addresses[0], 0x10008), 316U);
}

TEST(CameraFuzz, AFloodOfResendRequestsIsBoundedAndFramesGoOn) {
  const ServedRig rig(115, 1);
  const std::string& address = rig.addresses[0];
  ArvClient client(address);
  client.Start("Line1", 576);
  const RawClient raw;
  raw.Pulse(rig.server->BusPort(), {.sequence = 0, .scheduled_ns = 1});
  ASSERT_TRUE(client.Next());
  // From the controller's address, as a client gone mad: everything again, 20,000 times.
  RawClient mad;
  const Bytes request = {0x42, 0, 0, 0x40, 0, 12, 0, 1,    0,    0,
                         0,    1, 0, 0,    0, 0,  0, 0xFF, 0xFF, 0xFF};
  for (int i = 0; i < 20000; ++i) mad.Send(address, kGvcpPort, request);
  raw.Pulse(rig.server->BusPort(), {.sequence = 1, .scheduled_ns = 2});
  const auto frame = client.Next(20000);
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->status, ARV_BUFFER_STATUS_SUCCESS);
  EXPECT_TRUE(frame->image.pixels == rig.frames.At(0, {.sequence = 1}).pixels);
  const ServedCameraStats stats = rig.server->Stats()[0];
  EXPECT_LT(stats.resends_requested, 20000LL * 145) << "more than the queue holds is dropped";
}

}  // namespace
}  // namespace sole::sim
