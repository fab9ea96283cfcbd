#include "capture/trigger.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "capture/host_clock.h"
#include "core/error.h"
#include "core/trigger_bus.h"
#include "tests/support/error_matcher.h"

namespace sole::capture {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using testing_support::ErrorOf;

/// A listening end of the trigger bus on a free port.
class Bus {
 public:
  Bus() : socket_(socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(bind(socket_, reinterpret_cast<sockaddr*>(&address), size), 0);
    getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size);
    port = ntohs(address.sin_port);
    const timeval timeout{2, 0};
    setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
  }
  ~Bus() { close(socket_); }
  std::optional<TriggerPulse> Receive() {
    std::array<std::uint8_t, 64> bytes{};
    const ssize_t size = recv(socket_, bytes.data(), bytes.size(), 0);
    if (size < 0) return {};
    return DecodeTriggerPulse({bytes.data(), static_cast<std::size_t>(size)});
  }
  int port = 0;

 private:
  int socket_;
};

TEST(SimulatedTrigger, PulsesCarrySequenceKindAndTheirMoment) {
  Bus bus;
  const auto trigger = MakeSimulatedTrigger(bus.port);
  TriggerLog log;
  const TriggerSchedule schedule{.start_ns = HostNowNs() + 5'000'000,
                                 .period_ns = 5'000'000,
                                 .first_sequence = -1,
                                 .count = 5,
                                 .cycle = {ExposureKind::kSpeckle, ExposureKind::kTexture}};
  EXPECT_EQ(FireSchedule(*trigger, schedule, log), 5);
  for (std::int64_t i = 0; i < 5; ++i) {
    const auto pulse = bus.Receive();
    ASSERT_TRUE(pulse);
    EXPECT_EQ(pulse->sequence, i - 1);
    EXPECT_EQ(pulse->kind, static_cast<std::uint32_t>(i % 2));
    EXPECT_EQ(pulse->scheduled_ns, log.Find(i - 1)->actual_ns);
  }
}

TEST(FireSchedule, DeadlinesAreAbsoluteAndNeverEarly) {
  const auto trigger = MakeSoftwareTrigger({});
  TriggerLog log;
  const std::int64_t start = HostNowNs() + 2'000'000;
  FireSchedule(*trigger, {.start_ns = start, .period_ns = 3'000'000, .count = 50}, log);
  const auto edges = log.Edges();
  ASSERT_EQ(edges.size(), 50u);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    EXPECT_EQ(edges[i].scheduled_ns, start + static_cast<std::int64_t>(i) * 3'000'000);
    EXPECT_GE(edges[i].actual_ns, edges[i].scheduled_ns);
  }
}

TEST(FireSchedule, LateEdgeKeepsItsDistanceAndTheScheduleIsCaughtUp) {
  int calls = 0;
  const auto trigger = MakeSoftwareTrigger({[&] {
    if (++calls == 3) SleepUntilNs(HostNowNs() + 35'000'000);  // holds the line for 3.5 periods
  }});
  TriggerLog log;
  const std::int64_t period = 10'000'000;
  FireSchedule(*trigger, {.start_ns = HostNowNs(), .period_ns = period, .count = 40}, log);
  const auto edges = log.Edges();
  for (std::size_t i = 1; i < edges.size(); ++i) {
    EXPECT_GE(edges[i].actual_ns - edges[i - 1].actual_ns, period * 4 / 5);
  }
  EXPECT_GT(edges[3].actual_ns - edges[3].scheduled_ns, 20'000'000);
  // Made up at 2 ms an edge; a busy host may hold single edges up again.
  const auto late = [](const TriggerEdge& edge) { return edge.actual_ns - edge.scheduled_ns; };
  const auto caught_up =
      std::min_element(edges.begin() + 4, edges.end(),
                       [&](const auto& a, const auto& b) { return late(a) < late(b); });
  EXPECT_LT(late(*caught_up), late(edges[3]));
}

TEST(FireSchedule, StopsBeforeTheNextEdge) {
  std::atomic<bool> stop{false};
  int calls = 0;
  const auto trigger = MakeSoftwareTrigger({[&] { stop = ++calls == 4; }});
  TriggerLog log;
  EXPECT_EQ(FireSchedule(*trigger, {.start_ns = HostNowNs(), .period_ns = 1'000'000, .count = 100},
                         log, &stop),
            4);
  EXPECT_EQ(log.Size(), 4);
}

TEST(TriggerLog, NearestPicksTheCloserNeighbour) {
  TriggerLog log;
  EXPECT_FALSE(log.Nearest(5));
  log.Append({1, ExposureKind::kSpeckle, 100, 100});
  log.Append({2, ExposureKind::kSpeckle, 200, 200});
  EXPECT_EQ(log.Nearest(-50)->sequence, 1);
  EXPECT_EQ(log.Nearest(149)->sequence, 1);
  EXPECT_EQ(log.Nearest(151)->sequence, 2);
  EXPECT_EQ(log.Nearest(900)->sequence, 2);
  EXPECT_FALSE(log.Find(3));
}

TEST(GpioTrigger, MissingChipIsNamed) {
  EXPECT_THAT(ErrorOf([] { MakeGpioTrigger({.chip = "gpiochip977", .strobes = {}, .readback_line = {}}); }),
              AllOf(HasSubstr("/dev/gpiochip977"), HasSubstr("gpio_chip")));
}

TEST(SimulatedTrigger, ImpossiblePortIsRefused) {
  EXPECT_THROW(MakeSimulatedTrigger(0), Error);
  EXPECT_THROW(MakeSimulatedTrigger(70000), Error);
}

}  // namespace
}  // namespace sole::capture
