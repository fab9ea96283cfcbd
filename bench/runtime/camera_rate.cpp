// Serves simulated cameras to a stock Aravis client in the same process, fires the trigger bus and
// prints one line: frames asked, received whole, lost; packets resent; processor time. Usage:
// bench_camera_rate [cameras = 4] [rate_hz = 10] [seconds = 10] [drop_probability = 0]
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include <arpa/inet.h>
#include <arv.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>

#include "core/error.h"
#include "core/trigger_bus.h"
#include "sim/camera_server.h"

namespace {

using Clock = std::chrono::steady_clock;
constexpr int kWidth = 1624, kHeight = 1236;

/// One camera: its stream and the thread that takes its frames.
class Receiver {
 public:
  explicit Receiver(const std::string& address) {
    GError* error = nullptr;
    camera_ = arv_camera_new(address.c_str(), &error);
    sole::Require(camera_ != nullptr, "cannot open the camera at " + address);
    ArvGvDevice* device = ARV_GV_DEVICE(arv_camera_get_device(camera_));
    arv_gv_device_set_stream_options(device, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
    arv_gv_device_set_packet_size(device, 9000, nullptr);
    arv_camera_set_trigger(camera_, "Line1", nullptr);
    stream_ = arv_camera_create_stream(camera_, nullptr, nullptr, &error);
    sole::Require(stream_ != nullptr, "cannot open the stream of " + address);
    g_object_set(stream_, "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size",
                 4 << 20, nullptr);
    for (int i = 0; i < 20; ++i)
      arv_stream_push_buffer(stream_, arv_buffer_new_allocate(kWidth * kHeight));
    arv_camera_start_acquisition(camera_, nullptr);
    thread_ = std::thread([this] { Run(); });
  }
  ~Receiver() {
    stop_ = true;
    thread_.join();
    arv_camera_stop_acquisition(camera_, nullptr);
    g_object_unref(stream_);
    g_object_unref(camera_);
  }
  Receiver(const Receiver&) = delete;
  Receiver& operator=(const Receiver&) = delete;

  std::atomic<int> whole{0};
  std::atomic<int> holed{0};
  std::uint64_t Resent() const {
    return arv_stream_get_info_uint64_by_name(stream_, "n_resent_packets");
  }

 private:
  void Run() {
    while (!stop_) {
      ArvBuffer* buffer = arv_stream_timeout_pop_buffer(stream_, 100000);
      if (buffer == nullptr) continue;
      ++(arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_SUCCESS ? whole : holed);
      arv_stream_push_buffer(stream_, buffer);
    }
  }

  ArvCamera* camera_ = nullptr;
  ArvStream* stream_ = nullptr;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// The trigger line.
class Bus {
 public:
  explicit Bus(int port) : socket_(socket(AF_INET, SOCK_DGRAM, 0)) {
    to_.sin_family = AF_INET;
    to_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to_.sin_port = htons(static_cast<std::uint16_t>(port));
  }
  void Fire(std::int64_t sequence) const {
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    const auto bytes =
        sole::Encode({.sequence = sequence, .scheduled_ns = std::chrono::nanoseconds(now).count()});
    (void)!sendto(socket_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to_),
                  sizeof to_);
  }

 private:
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

void Measure(int cameras, double rate_hz, double seconds, double drop_probability) {
  std::vector<sole::sim::ServedCamera> served;
  sole::sim::CameraServerOptions options{.link_mbit_per_s = rate_hz > 50 ? 2500.0 : 1000.0};
  for (int i = 0; i < cameras; ++i) {
    served.push_back(
        {.serial = fmt::format("RATE{:02}", i + 1), .address = fmt::format("127.0.77.{}", i + 1)});
    options.faults.push_back({.packet_drop_probability = drop_probability});
  }
  sole::ImageU8 image(kWidth, kHeight);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = static_cast<std::uint8_t>(i * 7);
  const sole::sim::CameraServer server(
      served, 0, [&](int, const sole::TriggerPulse&) -> const sole::ImageU8& { return image; },
      options);
  std::vector<std::unique_ptr<Receiver>> receivers;
  for (const auto& camera : served) receivers.push_back(std::make_unique<Receiver>(camera.address));

  const Bus bus(server.BusPort());
  constexpr int kWarmUp = 3;
  for (int i = 1 - kWarmUp; i <= 0; ++i) {
    bus.Fire(i);
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
  }
  for (const auto& receiver : receivers) receiver->whole = receiver->holed = 0;
  const double processor_before = ProcessorSeconds();
  const Clock::time_point begin = Clock::now();
  const int triggers = static_cast<int>(rate_hz * seconds);
  for (int i = 0; i < triggers; ++i) {
    std::this_thread::sleep_until(
        begin + std::chrono::nanoseconds(static_cast<std::int64_t>(1e9 * i / rate_hz)));
    bus.Fire(i + 1);
  }
  std::this_thread::sleep_for(std::chrono::seconds(1));
  int whole = 0, holed = 0;
  std::uint64_t resent = 0;
  for (const auto& receiver : receivers) {
    whole += receiver->whole;
    holed += receiver->holed;
    resent += receiver->Resent();
  }
  fmt::print(
      "{} cameras {} Hz: {} frames asked, {} whole, {} with holes, {} never seen; {} packets "
      "resent; "
      "{:.2f} s of processor time in {:.1f} s\n",
      cameras, rate_hz, cameras * triggers, whole, holed, cameras * triggers - whole - holed,
      resent, ProcessorSeconds() - processor_before,
      std::chrono::duration<double>(Clock::now() - begin).count());
}

}  // namespace

int main(int argc, char** argv) {
  const auto argument = [&](int i, double otherwise) {
    return argc > i ? std::atof(argv[i]) : otherwise;
  };
  try {
    Measure(static_cast<int>(argument(1, 4)), argument(2, 10), argument(3, 10), argument(4, 0));
  } catch (const sole::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
  return 0;
}
