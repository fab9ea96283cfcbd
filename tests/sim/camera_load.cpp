#include "tests/sim/camera_load.h"

#include <arpa/inet.h>
#include <dirent.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <memory>
#include <sstream>
#include <thread>
#include <vector>

#include "core/error.h"
#include "core/trigger_bus.h"
#include "sim/camera_server.h"
#include "tests/sim/load_receiver.h"

namespace sole::sim {
namespace {

using Clock = std::chrono::system_clock;

constexpr int kGvcpPort = 3956;

/// Fires the line or the action.
class Trigger {
 public:
  Trigger(LoadTrigger kind, int bus_port) : kind_(kind), socket_(socket(AF_INET, SOCK_DGRAM, 0)) {
    const int yes = 1;
    setsockopt(socket_, SOL_SOCKET, SO_BROADCAST, &yes, sizeof yes);
    sockaddr_in local{};
    local.sin_family = AF_INET;
    local.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    bind(socket_, reinterpret_cast<const sockaddr*>(&local), sizeof local);
    to_.sin_family = AF_INET;
    to_.sin_addr.s_addr = htonl(kind == LoadTrigger::kLine ? INADDR_LOOPBACK : INADDR_BROADCAST);
    to_.sin_port =
        htons(static_cast<std::uint16_t>(kind == LoadTrigger::kLine ? bus_port : kGvcpPort));
  }
  ~Trigger() { close(socket_); }
  Trigger(const Trigger&) = delete;
  Trigger& operator=(const Trigger&) = delete;

  void Fire(std::int64_t trigger, std::int64_t time_ns) const {
    if (kind_ == LoadTrigger::kLine) {
      Send(Encode(TriggerPulse{.sequence = trigger, .scheduled_ns = time_ns}));
      return;
    }
    std::array<std::uint8_t, 20> action = {0x42, 0, 0x01, 0x00, 0, 12, 0, 1};
    const auto store = [&](std::size_t at, std::uint32_t value) {
      const std::uint32_t big_endian = htonl(value);
      std::memcpy(action.data() + at, &big_endian, 4);
    };
    store(8, kLoadDeviceKey);
    store(12, kLoadGroupKey);
    store(16, kLoadGroupMask);
    Send(action);
  }

 private:
  template <typename Bytes>
  void Send(const Bytes& bytes) const {
    const auto sent = sendto(socket_, bytes.data(), bytes.size(), 0,
                             reinterpret_cast<const sockaddr*>(&to_), sizeof to_);
    Require(sent == static_cast<ssize_t>(bytes.size()),
            std::string("cannot send a trigger: ") + std::strerror(errno));
  }
  LoadTrigger kind_;
  int socket_;
  sockaddr_in to_{};
};

double ProcessorSeconds() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// Processor time of this process' threads whose name begins with `name`.
double ProcessorSecondsOf(const std::string& name) {
  double ticks = 0;
  DIR* directory = opendir("/proc/self/task");
  while (directory != nullptr) {
    const dirent* entry = readdir(directory);
    if (entry == nullptr) break;
    std::string line;
    std::getline(std::ifstream(fmt::format("/proc/self/task/{}/stat", entry->d_name)), line);
    const std::size_t open = line.find('('), close = line.rfind(')');
    if (open == std::string::npos || line.compare(open + 1, name.size(), name) != 0) continue;
    std::istringstream rest(line.substr(close + 1));
    std::string field;
    for (int i = 0; i < 11; ++i) rest >> field;  // up to majflt's child count
    double user = 0, system = 0;
    rest >> user >> system;
    ticks += user + system;
  }
  if (directory != nullptr) closedir(directory);
  return ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
}

template <typename Condition>
bool WaitFor(double seconds, const Condition& condition) {
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  while (!condition()) {
    if (Clock::now() >= end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

}  // namespace

CameraLoadResult RunCameraLoad(const CameraLoadOptions& options) {
  const ImageSets sets(options);
  FireLog fired(options.triggers);
  std::vector<ServedCamera> served;
  CameraServerOptions server_options{.link_mbit_per_s = options.link_mbit_per_s};
  for (int i = 0; i < options.cameras; ++i) {
    served.push_back({.serial = fmt::format("LOAD{}-{:02}", options.net, i + 1),
                      .address = fmt::format("127.0.{}.{}", options.net, i + 1),
                      .width = options.width,
                      .height = options.height});
    server_options.faults.push_back({.packet_drop_probability = options.packet_drop_probability});
  }
  const CameraServer server(
      served, 0,
      [&](int camera, const TriggerPulse& pulse) -> const ImageU8& {
        return sets.images[sets.SetOf(pulse.sequence)][static_cast<std::size_t>(camera)];
      },
      server_options);
  std::vector<std::unique_ptr<LoadReceiver>> receivers;
  for (int i = 0; i < options.cameras; ++i) {
    receivers.push_back(std::make_unique<LoadReceiver>(
        options, i, served[static_cast<std::size_t>(i)].address, sets, fired));
  }
  const Trigger trigger(options.trigger, server.BusPort());
  for (int i = 1 - kLoadWarmUps; i <= 0; ++i) {
    trigger.Fire(i, LoadNowNs());
    const bool answered = WaitFor(10, [&] {
      return std::all_of(receivers.begin(), receivers.end(),
                         [&](const auto& r) { return r->WarmUps() >= i + kLoadWarmUps; });
    });
    Require(answered, "not every camera answered a warm-up trigger");
  }

  CameraLoadResult total;
  total.asked = std::int64_t{options.cameras} * options.triggers;
  const double processor = ProcessorSeconds(), server_processor = ProcessorSecondsOf("sole-cam");
  const auto begin = Clock::now();
  for (int i = 0; i < options.triggers; ++i) {
    const auto at = begin + std::chrono::nanoseconds(std::llround(1e9 * i / options.rate_hz));
    std::this_thread::sleep_until(at);
    const std::int64_t time_ns = LoadNowNs();
    fired.Set(i + 1, time_ns);
    trigger.Fire(i + 1, time_ns);
  }
  WaitFor(2, [&] {
    return std::all_of(receivers.begin(), receivers.end(),
                       [&](const auto& r) { return r->Counted() >= options.triggers; });
  });
  total.elapsed_s = std::chrono::duration<double>(Clock::now() - begin).count();
  total.processor_s = ProcessorSeconds() - processor;
  total.server_processor_s = ProcessorSecondsOf("sole-cam") - server_processor;
  for (const auto& receiver : receivers) {
    receiver->Stop();
    const CameraLoadResult& one = receiver->Result();
    total.right += one.right;
    total.wrong_image += one.wrong_image;
    total.wrong_stamp += one.wrong_stamp;
    total.incomplete += one.incomplete;
    total.latest_s = std::max(total.latest_s, one.latest_s);
    total.mean_latency_s += one.mean_latency_s;
    total.packets_resent += receiver->Resent();
  }
  total.mean_latency_s /= static_cast<double>(std::max<std::int64_t>(total.right, 1));
  total.never_came =
      total.asked - total.right - total.wrong_image - total.wrong_stamp - total.incomplete;
  for (const ServedCameraStats& stats : server.Stats()) {
    total.packets_dropped += stats.packets_dropped;
    total.resends_refused += stats.resends_refused;
  }
  total.bytes_per_s = static_cast<double>(total.asked) * options.width * options.height /
                      (options.triggers / options.rate_hz);
  return total;
}

std::string Describe(const CameraLoadOptions& options, const CameraLoadResult& result) {
  return fmt::format(
      "{} cameras {} x {} at {} Hz, {:.0f} MB/s, {} sets, by {}, {:.2f} % of packets dropped: "
      "{} frames asked, {} right, {} of a wrong image, {} with a wrong stamp, {} incomplete, "
      "{} never came; {} packets dropped, {} resent, {} resends refused; latency mean {:.0f} ms, "
      "worst {:.0f} ms; {:.2f} s of processor time in {:.1f} s ({:.2f} cores), {:.2f} s of it the "
      "server's",
      options.cameras, options.width, options.height, options.rate_hz, 1e-6 * result.bytes_per_s,
      options.sets, options.trigger == LoadTrigger::kLine ? "line" : "action",
      100 * options.packet_drop_probability, result.asked, result.right, result.wrong_image,
      result.wrong_stamp, result.incomplete, result.never_came, result.packets_dropped,
      result.packets_resent, result.resends_refused, 1e3 * result.mean_latency_s,
      1e3 * result.latest_s, result.processor_s, result.elapsed_s,
      result.processor_s / result.elapsed_s, result.server_processor_s);
}

}  // namespace sole::sim
