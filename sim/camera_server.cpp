#include "sim/camera_server.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <mutex>
#include <set>
#include <thread>
#include <utility>

#include <arpa/inet.h>
#include <fmt/format.h>
#include <pthread.h>
#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

#include "core/error.h"
#include "sim/gige/gvcp_server.h"

namespace sole::sim {
namespace {

constexpr std::uint32_t kLoopback = 0x7F000001;
// Packets read from one socket before the others have their turn again.
constexpr int kPacketsPerTurn = 1024;

std::uint32_t ParseLoopback(const ServedCamera& camera) {
  in_addr address{};
  const bool parsed = inet_pton(AF_INET, camera.address.c_str(), &address) == 1;
  const std::uint32_t value = ntohl(address.s_addr);
  Require(parsed && value >> 24 == 127 && value != 0x7FFFFFFF && value != 0x7F000000,
          fmt::format("camera {}: '{}' is not a loopback address; give it one such as 127.0.0.11",
                      camera.serial, camera.address));
  return value;
}

void ValidateFaults(const CameraFaults& faults) {
  Require(faults.packet_drop_probability >= 0 && faults.packet_drop_probability < 1,
          fmt::format("packet_drop_probability is {}; it must be in [0, 1)",
                      faults.packet_drop_probability));
}

void ValidateAll(const std::vector<ServedCamera>& cameras, const CameraServerOptions& options) {
  Require(!cameras.empty(), "the camera server has no cameras; give it at least one");
  Require(options.first_frame_id >= 1, "first_frame_id is 0; frame ids run from 1 to 65535");
  Require(options.link_mbit_per_s >= 1 && options.link_mbit_per_s <= 1e6,
          fmt::format("link_mbit_per_s is {}; it must be 1 to 1000000", options.link_mbit_per_s));
  std::set<std::string> serials, addresses;
  for (const ServedCamera& camera : cameras) {
    const auto printable = [](char c) { return c > ' ' && c < 127; };
    Require(
        !camera.serial.empty() && camera.serial.size() <= 15 &&
            std::all_of(camera.serial.begin(), camera.serial.end(), printable),
        fmt::format("camera serial '{}' must have 1 to 15 printable characters", camera.serial));
    Require(
        camera.width >= 4 && camera.width <= 16384 && camera.height >= 4 && camera.height <= 16384,
        fmt::format("camera {}: {} x {} pixels; each must be 4 to 16384", camera.serial,
                    camera.width, camera.height));
    Require(
        camera.exposure_us >= 10 && camera.exposure_us <= 1e6 && camera.gain_db >= 0 &&
            camera.gain_db <= 48,
        fmt::format("camera {}: exposure {} us, gain {} dB; they must be 10 to 1000000 and 0 to 48",
                    camera.serial, camera.exposure_us, camera.gain_db));
    Require(serials.insert(camera.serial).second,
            fmt::format("two cameras have the serial {}", camera.serial));
    Require(addresses.insert(camera.address).second,
            fmt::format("two cameras have the address {}", camera.address));
  }
  for (const CameraFaults& faults : options.faults) ValidateFaults(faults);
}

/// Owns an epoll, event or timer descriptor.
struct Descriptor {
  explicit Descriptor(int fd) : value(fd) {
    Require(value >= 0, fmt::format("the camera server cannot get a file descriptor: {}",
                                    std::strerror(errno)));
  }
  ~Descriptor() { close(value); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  const int value;
};

}  // namespace

/// Sockets of device i are numbered i; then come the bus, the broadcast address, the timer
/// and the stop event.
struct CameraServer::Impl {
  Impl(std::vector<ServedCamera> served, int bus_port, const FrameProvider& provider,
       CameraServerOptions options_in);
  ~Impl();

  void Run();
  void Watch(int descriptor, std::size_t number);
  void OnReadable(std::size_t number);
  void OnControl(std::size_t camera);
  void OnBroadcast();
  void OnBus();
  void OnTimer();
  void SetTimer();

  const std::vector<ServedCamera> cameras;
  mutable std::mutex mutex;  // Guards the devices.
  std::vector<std::unique_ptr<CameraDevice>> devices;
  std::vector<std::unique_ptr<UdpSocket>> control;
  UdpSocket bus;
  // Shared: every process with devices hears discovery and broadcast actions.
  UdpSocket broadcast{{0xFFFFFFFF, kGvcpPort}, "camera discovery", true};
  Descriptor epoll{epoll_create1(EPOLL_CLOEXEC)};
  Descriptor timer{timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)};
  Descriptor stop{eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)};
  std::vector<std::uint8_t> buffer = std::vector<std::uint8_t>(65536);
  std::thread thread;
};

CameraServer::Impl::Impl(std::vector<ServedCamera> served, int bus_port,
                         const FrameProvider& provider, CameraServerOptions options)
    : cameras(std::move(served)),
      bus({kLoopback, static_cast<std::uint16_t>(bus_port)}, "the trigger bus") {
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const std::uint32_t address = ParseLoopback(cameras[i]);
    control.push_back(
        std::make_unique<UdpSocket>(Endpoint{address, kGvcpPort}, "camera " + cameras[i].serial));
    devices.push_back(
        std::make_unique<CameraDevice>(cameras[i],
                                       GvspSenderOptions{.address = address,
                                                         .camera = static_cast<int>(i),
                                                         .link_mbit_per_s = options.link_mbit_per_s,
                                                         .first_frame_id = options.first_frame_id,
                                                         .seed = options.seed + 1000 * i},
                                       provider, options.schedule));
    if (i < options.faults.size()) devices[i]->Sender().SetFaults(options.faults[i]);
    Watch(control[i]->Descriptor(), i);
  }
  std::size_t number = cameras.size();
  for (const int descriptor : {bus.Descriptor(), broadcast.Descriptor(), timer.value, stop.value}) {
    Watch(descriptor, number++);
  }
  thread = std::thread([this] { Run(); });
}

CameraServer::Impl::~Impl() {
  const std::uint64_t one = 1;
  (void)!write(stop.value, &one, sizeof one);
  thread.join();
}

void CameraServer::Impl::Watch(int descriptor, std::size_t number) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.u64 = number;
  epoll_ctl(epoll.value, EPOLL_CTL_ADD, descriptor, &event);
}

void CameraServer::Impl::Run() {
  pthread_setname_np(pthread_self(), "sole-cam-ctl");
  const std::size_t stop_number = cameras.size() + 3;
  std::array<epoll_event, 32> events{};
  for (;;) {
    const int count = epoll_wait(epoll.value, events.data(), static_cast<int>(events.size()), -1);
    const std::lock_guard lock(mutex);
    for (int i = 0; i < count; ++i) {
      const auto number = static_cast<std::size_t>(events[static_cast<std::size_t>(i)].data.u64);
      if (number == stop_number) return;
      OnReadable(number);
    }
    SetTimer();
  }
}

void CameraServer::Impl::OnReadable(std::size_t number) {
  const std::size_t n = cameras.size();
  if (number < n) OnControl(number);
  if (number == n) OnBus();
  if (number == n + 1) OnBroadcast();
  if (number == n + 2) OnTimer();
}

void CameraServer::Impl::OnControl(std::size_t camera) {
  Endpoint from;
  for (int i = 0; i < kPacketsPerTurn; ++i) {
    const auto packet = control[camera]->Receive(buffer, &from);
    if (!packet) return;
    if (devices[camera]->Unreachable()) continue;
    const std::vector<std::uint8_t> ack = AnswerGvcp(*packet, from, false, devices[camera].get());
    if (!ack.empty()) control[camera]->Send(ack, from);
  }
}

void CameraServer::Impl::OnBroadcast() {
  Endpoint from;
  for (int turn = 0; turn < kPacketsPerTurn; ++turn) {
    const auto packet = broadcast.Receive(buffer, &from);
    if (!packet) return;
    if (from.address >> 24 != 127) continue;  // Simulated cameras stay on this computer.
    for (std::size_t i = 0; i < devices.size(); ++i) {
      if (devices[i]->Unreachable()) continue;
      const std::vector<std::uint8_t> ack = AnswerGvcp(*packet, from, true, devices[i].get());
      if (!ack.empty()) control[i]->Send(ack, from);
    }
  }
}

void CameraServer::Impl::OnBus() {
  Endpoint from;
  for (int i = 0; i < kPacketsPerTurn; ++i) {
    const auto packet = bus.Receive(buffer, &from);
    if (!packet) return;
    const std::optional<TriggerPulse> pulse = DecodeTriggerPulse(*packet);
    if (!pulse) continue;
    for (const auto& device : devices) device->OnPulse(*pulse);
  }
}

void CameraServer::Impl::OnTimer() {
  std::uint64_t expirations = 0;
  (void)!read(timer.value, &expirations, sizeof expirations);
  // A heartbeat that waits in its socket counts, however late this thread is.
  for (std::size_t i = 0; i < devices.size(); ++i) OnControl(i);
  const auto now = CameraDevice::Clock::now();
  for (const auto& device : devices) device->OnTimer(now);
}

void CameraServer::Impl::SetTimer() {
  std::optional<CameraDevice::Clock::time_point> next;
  for (const auto& device : devices) {
    const auto deadline = device->NextDeadline();
    if (deadline && (!next || *deadline < *next)) next = deadline;
  }
  itimerspec setting{};  // Zero disarms. steady_clock is CLOCK_MONOTONIC.
  if (next) {
    const auto ns =
        std::chrono::duration_cast<std::chrono::nanoseconds>(next->time_since_epoch()).count();
    setting.it_value.tv_sec = ns / 1000000000;
    setting.it_value.tv_nsec = ns % 1000000000;
  }
  timerfd_settime(timer.value, TFD_TIMER_ABSTIME, &setting, nullptr);
}

CameraServer::CameraServer(std::vector<ServedCamera> cameras, int bus_port, FrameProvider provider,
                           CameraServerOptions options) {
  ValidateAll(cameras, options);
  Require(bus_port >= 0 && bus_port <= 65535,
          fmt::format("trigger bus port {} is not 0 to 65535", bus_port));
  Require(static_cast<bool>(provider), "the camera server has no frame provider");
  impl_ = std::make_unique<Impl>(std::move(cameras), bus_port, provider, std::move(options));
}

CameraServer::~CameraServer() = default;

int CameraServer::BusPort() const { return impl_->bus.Local().port; }

std::vector<ServedCameraStats> CameraServer::Stats() const {
  const std::lock_guard lock(impl_->mutex);
  std::vector<ServedCameraStats> all;
  for (std::size_t i = 0; i < impl_->cameras.size(); ++i) {
    all.push_back(impl_->devices[i]->Sender().Stats());
    all.back().serial = impl_->cameras[i].serial;
    all.back().controlled = impl_->devices[i]->Controlled();
  }
  return all;
}

void CameraServer::SetFaults(int camera, const CameraFaults& faults) {
  Require(camera >= 0 && camera < static_cast<int>(impl_->cameras.size()),
          fmt::format("there is no camera {}; the server has {}", camera, impl_->cameras.size()));
  ValidateFaults(faults);
  impl_->devices[static_cast<std::size_t>(camera)]->Sender().SetFaults(faults);
}

}  // namespace sole::sim
