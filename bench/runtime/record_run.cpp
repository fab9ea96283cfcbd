#include "bench/runtime/record_run.h"

#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <memory>
#include <sstream>

#include "capture/recorder.h"
#include "core/error.h"
#include "io/bytes_internal.h"
#include "io/raw_file.h"
#include "io/take.h"
#include "sim/camera_server.h"

namespace sole::bench {

namespace fs = std::filesystem;

namespace {

constexpr int kImages = 16;

/// Which image a camera shows at a trigger: never that of the trigger before, nor a neighbour's.
std::size_t Shown(int camera, std::int64_t trigger) {
  return static_cast<std::size_t>(((trigger + 5 * camera) % kImages + kImages) % kImages);
}

std::vector<ImageU8> MakeImages(const RecordRunOptions& options) {
  std::vector<ImageU8> images;
  for (int i = 0; i < kImages; ++i) {
    ImageU8& image = images.emplace_back(options.width, options.height);
    auto state = static_cast<std::uint32_t>(i + 1) * 2654435761U;
    for (std::uint8_t& pixel : image.pixels) {
      state = state * 1664525U + 1013904223U;
      pixel = static_cast<std::uint8_t>(state >> 24);
    }
  }
  return images;
}

std::string Serial(const RecordRunOptions& options, int camera) {
  return "BENCH" + std::to_string(options.net) + "C" + std::to_string(camera + 1);
}

RigConfig ConfigFor(const RecordRunOptions& options, int bus_port) {
  RigConfig config;
  config.name = "bench";
  const double packets = std::ceil(static_cast<double>(options.width) * options.height /
                                   static_cast<double>(options.packet_size - 36));
  for (int i = 0; i < options.cameras; ++i) {
    CameraConfig camera;
    camera.serial = Serial(options, i);
    camera.address = "127.0." + std::to_string(options.net) + "." + std::to_string(i + 1);
    camera.width = options.width;
    camera.height = options.height;
    camera.look_at_m = {0, 1, 0};
    camera.exposure_us = 500;
    camera.packet_size = options.packet_size;
    camera.packet_delay_ns = static_cast<int>(options.spread * 1e9 / options.rate_hz / packets);
    config.cameras.push_back(camera);
  }
  config.trigger.rate_hz = options.rate_hz;
  config.trigger.bus_port = bus_port;
  return config;
}

/// The simulated cameras, in this process or one of their own.
class Server {
 public:
  Server(const RecordRunOptions& options, const std::vector<ImageU8>& images) {
    if (!options.own_process) {
      server_ = Serve(options, images);
      bus_port_ = server_->BusPort();
      return;
    }
    int port[2], end[2];
    Require(::pipe(port) == 0 && ::pipe(end) == 0, "no pipes left");
    child_ = ::fork();
    Require(child_ >= 0, "no process left");
    if (child_ == 0) {
      ::close(end[1]);
      int number = 0;
      std::unique_ptr<sim::CameraServer> server;
      try {
        server = Serve(options, images);
        number = server->BusPort();
      } catch (const std::exception& error) {
        std::fprintf(stderr, "%s\n", error.what());
      }
      char byte;
      const bool told = ::write(port[1], &number, sizeof number) == sizeof number;
      while (told && server && ::read(end[0], &byte, 1) > 0) continue;
      server.reset();
      ::_exit(0);
    }
    ::close(port[1]);
    ::close(end[0]);
    end_ = end[1];
    const bool told = ::read(port[0], &bus_port_, sizeof bus_port_) == sizeof bus_port_;
    ::close(port[0]);
    Require(told && bus_port_ > 0, "the simulated cameras could not be served");
  }
  ~Server() {
    if (child_ < 0) return;
    ::close(end_);
    ::waitpid(child_, nullptr, 0);
  }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  int BusPort() const { return bus_port_; }

  /// User and system time so far; NaN within this process.
  double ProcessorSeconds() const {
    if (child_ < 0) return std::numeric_limits<double>::quiet_NaN();
    std::ifstream file("/proc/" + std::to_string(child_) + "/stat");
    std::string text;
    std::getline(file, text);
    std::istringstream fields(text.substr(text.rfind(')') + 1));
    std::string skipped;
    for (int i = 0; i < 11; ++i) fields >> skipped;
    double user = 0, system = 0;
    fields >> user >> system;
    return (user + system) / static_cast<double>(::sysconf(_SC_CLK_TCK));
  }

 private:
  static std::unique_ptr<sim::CameraServer> Serve(const RecordRunOptions& options,
                                                  const std::vector<ImageU8>& images) {
    std::vector<sim::ServedCamera> cameras;
    sim::CameraServerOptions server{.link_mbit_per_s = 10'000};
    for (const CameraConfig& camera : ConfigFor(options, 0).cameras) {
      cameras.push_back({.serial = camera.serial,
                         .address = camera.address,
                         .width = camera.width,
                         .height = camera.height});
      server.faults.push_back({.packet_drop_probability = options.drop});
    }
    return std::make_unique<sim::CameraServer>(
        cameras, 0,
        [&images](int camera, const TriggerPulse& pulse) -> const ImageU8& {
          return images[Shown(camera, pulse.sequence)];
        },
        server);
  }

  std::unique_ptr<sim::CameraServer> server_;
  pid_t child_ = -1;
  int end_ = -1;
  int bus_port_ = 0;
};

double OwnProcessorSeconds() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

/// A directory for one take that is removed again.
struct Scratch {
  explicit Scratch(const fs::path& below) {
    std::string name =
        ((below.empty() ? fs::temp_directory_path() : below) / "sole-bench-XXXXXX").string();
    Require(::mkdtemp(name.data()) != nullptr, "cannot write to " + name);
    path = name;
  }
  ~Scratch() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
  fs::path path;
};

}  // namespace

RecordRunResult RunRecording(const RecordRunOptions& options) {
  const std::vector<ImageU8> images = MakeImages(options);
  std::vector<std::uint32_t> crcs;
  for (const ImageU8& image : images)
    crcs.push_back(io::Crc32(image.pixels.data(), image.pixels.size()));
  const Server server(options, images);
  const RigConfig config = ConfigFor(options, server.BusPort());
  const Scratch scratch(options.directory);
  RecordRunResult result;
  std::atomic<std::int64_t> verified{0}, wrong{0};
  std::map<std::string, int> places;
  for (int i = 0; i < options.cameras; ++i) places[Serial(options, i)] = i;

  capture::RecordOptions record;
  record.directory = scratch.path / "take";
  record.subject = "bench";
  record.software = "bench";
  record.check_images = false;  // not of feet
  record.triggers = std::max<std::int64_t>(1, std::llround(options.rate_hz * options.seconds));
  record.discard = options.directory.empty();
  record.on_stored = [&](const std::string& serial, const io::RawRecordHeader& header,
                         std::uint32_t crc) {
    if (header.status != 0) return;
    const bool right = crc == crcs[Shown(places.at(serial), header.trigger)];
    ++(right ? verified : wrong);
  };
  double recorder_before = std::numeric_limits<double>::quiet_NaN(), simulator_before = 0;
  record.progress = [&](const capture::RecordProgress&) {
    if (!std::isnan(recorder_before)) return;
    recorder_before = OwnProcessorSeconds();
    simulator_before = server.ProcessorSeconds();
  };
  const capture::RecordResult recorded = capture::Record(config, record);
  result.recorder_cpu_s = OwnProcessorSeconds() - recorder_before;
  result.simulator_cpu_s = server.ProcessorSeconds() - simulator_before;
  result.expected = recorded.FramesExpected();
  result.verified = verified;
  result.wrong = wrong;
  result.reasons = recorded.reasons;
  result.trigger_late_max_s = recorded.trigger_late_max_s;
  for (const capture::CameraRecord& camera : recorded.cameras) {
    result.incomplete += camera.incomplete;
    result.lost += camera.lost;
    result.dropped += camera.dropped;
    result.resent_packets += camera.resent_packets;
    result.missing_packets += camera.missing_packets;
    result.latency_max_s = std::max(result.latency_max_s, camera.latency_max_s);
  }
  const io::TakePaths take{record.directory};
  const std::vector<io::TriggerRecord> triggers = io::ReadTriggers(take);
  if (!triggers.empty()) result.seconds = triggers.back().actual_s - triggers.front().actual_s;
  const double periods =
      static_cast<double>(triggers.size() - 1) / static_cast<double>(triggers.size());
  result.megabytes_per_s = 1e-6 * static_cast<double>(result.verified) * options.width *
                           options.height * periods / result.seconds;
  if (record.discard) return result;
  for (const CameraConfig& camera : config.cameras) {
    for (const io::RawRecord& entry : io::ReadRawIndex(take.Raw(camera.serial)).records) {
      if (entry.header.status == 0 && io::CheckRawRecord(take.Raw(camera.serial), entry) &&
          entry.payload_crc == crcs[Shown(places.at(camera.serial), entry.header.trigger)])
        ++result.reread;
    }
  }
  return result;
}

}  // namespace sole::bench
