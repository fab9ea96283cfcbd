// What the recorder sustains over loopback, with every frame compared with what was served:
//   bench_record sink     checksums every frame and stores none
//   bench_record disk     records to --directory at --rate, or at what 0.8 of the disk's own rate
//   allows bench_record limit    finds the highest rate that loses nothing, for each of --cameras
//   bench_record machine  what disk and loopback do by themselves
// Simulator and recorder run together on this machine. `--help` lists the options.
#include <fcntl.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <thread>

#include <CLI/CLI.hpp>
#include <fmt/format.h>

#include "bench/runtime/record_run.h"
#include "core/error.h"
#include "io/disk_rate.h"

namespace sole::bench {
namespace {

using Clock = std::chrono::steady_clock;
double SecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Plain writes of 4 MiB past the page cache into `files` files side by side, fsynced: MB/s.
double PlainDiskRate(const std::filesystem::path& directory, int files, double seconds) {
  constexpr std::size_t kBlock = 4 << 20;
  std::atomic<std::uint64_t> written{0};
  const Clock::time_point begin = Clock::now();
  std::vector<std::thread> threads;
  for (int i = 0; i < files; ++i) {
    threads.emplace_back([&, i] {
      const std::string path =
          (directory / ("plain-" + std::to_string(getpid()) + "-" + std::to_string(i))).string();
      void* block = std::aligned_alloc(4096, kBlock);
      std::memset(block, 0x5a + i, kBlock);
      int file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_DIRECT, 0600);
      if (file < 0) file = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL, 0600);
      ::unlink(path.c_str());
      while (file >= 0 && SecondsSince(begin) < seconds && ::write(file, block, kBlock) == kBlock)
        written += kBlock;
      ::fsync(file);
      ::close(file);
      std::free(block);
    });
  }
  for (std::thread& thread : threads) thread.join();
  return 1e-6 * static_cast<double>(written) / SecondsSince(begin);
}

/// Datagrams of 9000 bytes from one thread to another as fast as they go: MB/s received.
double PlainLoopbackRate(double seconds) {
  const int receiver = ::socket(AF_INET, SOCK_DGRAM, 0), sender = ::socket(AF_INET, SOCK_DGRAM, 0);
  const int buffer = 8 << 20;
  ::setsockopt(receiver, SOL_SOCKET, SO_RCVBUFFORCE, &buffer, sizeof buffer);
  const timeval timeout{0, 100'000};
  ::setsockopt(receiver, SOL_SOCKET, SO_RCVTIMEO, &timeout, sizeof timeout);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  if (::bind(receiver, reinterpret_cast<sockaddr*>(&address), size) != 0) return 0;
  ::getsockname(receiver, reinterpret_cast<sockaddr*>(&address), &size);
  std::atomic<bool> done{false};
  std::uint64_t received = 0;
  std::thread reading([&] {
    std::vector<char> packet(9000);
    while (!done)
      received += static_cast<std::uint64_t>(
          std::max<ssize_t>(0, ::recv(receiver, packet.data(), packet.size(), 0)));
  });
  const std::vector<char> packet(9000, 'x');
  const Clock::time_point begin = Clock::now();
  while (SecondsSince(begin) < seconds) {
    for (int i = 0; i < 64; ++i)
      (void)!::sendto(sender, packet.data(), packet.size(), 0,
                      reinterpret_cast<sockaddr*>(&address), sizeof address);
  }
  const double spent = SecondsSince(begin);
  done = true;
  reading.join();
  ::close(receiver);
  ::close(sender);
  return 1e-6 * static_cast<double>(received) / spent;
}

void Print(const RecordRunOptions& options, const RecordRunResult& r) {
  fmt::print(
      "{} cameras x {}x{} at {:.2f} Hz for {:.1f} s, {:.1f} % of packets dropped: {:.1f} MB/s\n",
      options.cameras, options.width, options.height, options.rate_hz, r.seconds,
      100 * options.drop, r.megabytes_per_s);
  fmt::print(
      "  {} frames triggered, {} stored and verified, {} lost ({} of them dropped before the "
      "disk), {} incomplete, {} wrong{}\n",
      r.expected, r.verified, r.lost, r.dropped, r.incomplete, r.wrong,
      options.directory.empty() ? "" : fmt::format("; {} verified again from the disk", r.reread));
  fmt::print(
      "  {} packets missing at first, {} resent; latest frame {:.0f} ms after its trigger, latest "
      "trigger {:.1f} ms late\n",
      r.missing_packets, r.resent_packets, 1e3 * r.latency_max_s, 1e3 * r.trigger_late_max_s);
  const auto frames = static_cast<double>(std::max<std::int64_t>(1, r.expected));
  fmt::print(
      "  CPU per frame: recorder {:.2f} ms, simulator {:.2f} ms; cores busy: {:.2f} + {:.2f}\n",
      1e3 * r.recorder_cpu_s / frames, 1e3 * r.simulator_cpu_s / frames,
      r.recorder_cpu_s / std::max(0.1, r.seconds), r.simulator_cpu_s / std::max(0.1, r.seconds));
  for (const std::string& reason : r.reasons) fmt::print("  {}\n", reason);
  std::fflush(stdout);
}

bool Holds(RecordRunOptions options, double rate_hz) {
  options.rate_hz = rate_hz;
  try {
    const RecordRunResult result = RunRecording(options);
    fmt::print("  {:6.2f} Hz: {} of {} frames verified, {:.1f} MB/s\n", rate_hz, result.verified,
               result.expected, result.megabytes_per_s);
    std::fflush(stdout);
    return result.LostNothing();
  } catch (const Error& error) {
    fmt::print("  {:6.2f} Hz: {}\n", rate_hz, error.what());
    return false;
  }
}

/// Highest rate that loses nothing, to about 3 %, confirmed by a run of `confirm_s`.
void FindLimit(RecordRunOptions options, double confirm_s) {
  fmt::print("{} cameras{}:\n", options.cameras,
             options.directory.empty() ? ", checksummed" : ", to disk");
  double good = 0, bad = 1000;
  for (double rate = options.rate_hz; rate < bad && rate <= 240; rate *= 1.5)
    (Holds(options, rate) ? good : bad) = rate;
  for (double rate = options.rate_hz / 2; good == 0 && rate >= 0.5; rate /= 2)
    (Holds(options, rate) ? good : bad) = rate;
  while (good > 0 && bad <= 240 && bad / good > 1.03) {
    const double middle = 0.5 * (good + bad);
    (Holds(options, middle) ? good : bad) = middle;
  }
  for (options.seconds = confirm_s; good > 0.5; good *= 0.95) {
    options.rate_hz = good;
    const RecordRunResult result = RunRecording(options);
    Print(options, result);
    if (result.LostNothing()) break;
  }
}

int Main(int argc, char** argv) {
  CLI::App app{"What the recorder sustains over loopback"};
  std::string mode = "sink";
  RecordRunOptions options{.cameras = 20, .seconds = 0};
  std::vector<int> cameras{20};
  double confirm_s = 15;
  app.add_option("MODE", mode)
      ->check(CLI::IsMember({"sink", "disk", "limit", "machine"}))
      ->required();
  app.add_option("--cameras", cameras, "Several for limit: 4,8,20")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--rate", options.rate_hz, "Hz; of limit: where to begin")->capture_default_str();
  app.add_option("--seconds", options.seconds, "Default: 60 sink, 15 disk, 4 limit");
  app.add_option("--confirm", confirm_s, "Seconds at the rate that limit found")
      ->capture_default_str();
  app.add_option("--drop", options.drop, "Share of packets that get lost")->capture_default_str();
  app.add_option("--packet", options.packet_size, "Bytes")->capture_default_str();
  app.add_option("--spread", options.spread, "Share of the period over which packets are paced")
      ->capture_default_str();
  app.add_option("--width", options.width)->capture_default_str();
  app.add_option("--height", options.height)->capture_default_str();
  app.add_option("--directory", options.directory,
                 "Where to record; sink and limit: leave it out to store nothing");
  CLI11_PARSE(app, argc, argv);
  options.cameras = cameras.front();
  const auto or_default = [&](double seconds) {
    return options.seconds > 0 ? options.seconds : seconds;
  };
  const std::filesystem::path disk =
      options.directory.empty() ? std::filesystem::temp_directory_path() : options.directory;
  if (mode == "machine") {
    fmt::print("loopback by itself, one socket: {:.0f} MB/s\n", PlainLoopbackRate(3));
    fmt::print("disk below {} by itself, plain writes to {} files: {:.0f} MB/s\n", disk.string(),
               options.cameras, PlainDiskRate(disk, options.cameras, 5));
    fmt::print(
        "disk through the recorder's writer, {} files: {:.0f} MB/s\n", options.cameras,
        1e-6 * io::MeasureWriteRate(
                   disk, {.files = options.cameras, .max_bytes = 4ULL << 30, .max_seconds = 5}));
    return 0;
  }
  if (mode == "limit") {
    options.seconds = or_default(4);
    for (const int count : cameras) {
      options.cameras = count;
      FindLimit(options, confirm_s);
    }
    return 0;
  }
  if (mode == "sink") {
    options.directory.clear();
    options.seconds = or_default(60);
  } else {
    options.directory = disk;
    options.seconds = or_default(15);
    const double limit = PlainDiskRate(disk, options.cameras, 5);
    const double allowed =
        0.8e6 * limit / (static_cast<double>(options.cameras) * options.width * options.height);
    fmt::print("disk by itself: {:.0f} MB/s; 0.8 of it allows {:.2f} Hz: recording at {}\n", limit,
               allowed, allowed < options.rate_hz ? "that" : "the full rate");
    std::fflush(stdout);
    options.rate_hz = std::min(options.rate_hz, allowed);
  }
  const RecordRunResult result = RunRecording(options);
  Print(options, result);
  return result.LostNothing() && (options.directory.empty() || result.reread == result.verified)
             ? 0
             : 1;
}

}  // namespace
}  // namespace sole::bench

int main(int argc, char** argv) {
  try {
    return sole::bench::Main(argc, argv);
  } catch (const sole::Error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 1;
  }
}
