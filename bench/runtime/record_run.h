#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace sole::bench {

struct RecordRunOptions {
  int cameras = 4;
  double rate_hz = 10;
  double seconds = 5;
  int width = 1624;
  int height = 1236;
  double drop = 0.002;     ///< share of stream packets that the simulated network loses
  int packet_size = 9000;  ///< bytes
  double spread = 0.8;     ///< share of the period over which a camera's packets are paced
  int net = 78;            ///< cameras on 127.0.NET.1 onwards
  bool own_process =
      true;  ///< the simulator in a process of its own, so that its CPU time is told apart
  std::filesystem::path directory{};  ///< where to record; empty: checksum and discard
};

struct RecordRunResult {
  std::int64_t expected = 0;  ///< frames: triggers times cameras
  std::int64_t verified = 0;  ///< stored with exactly the pixels that were served at their trigger
  std::int64_t wrong = 0;     ///< stored, whole, with others
  std::int64_t incomplete = 0;
  std::int64_t lost = 0;
  std::int64_t dropped = 0;  ///< of the lost ones: the disk was too slow
  std::int64_t reread = 0;   ///< verified once more from the disk
  std::uint64_t resent_packets = 0;
  std::uint64_t missing_packets = 0;
  double seconds = 0;          ///< first to last trigger
  double megabytes_per_s = 0;  ///< pixels
  double recorder_cpu_s = 0;   ///< user and system, from the first trigger to the closed files
  double simulator_cpu_s = 0;  ///< NaN within one process
  double latency_max_s = 0;
  double trigger_late_max_s = 0;
  std::vector<std::string> reasons;  ///< of the take's verdict

  bool LostNothing() const { return verified == expected && wrong == 0; }
};

/// Serves simulated cameras on loopback, records them with the recorder as it is, and compares
/// every frame with what was served. Throws Error if the recording cannot begin.
RecordRunResult RunRecording(const RecordRunOptions& options);

}  // namespace sole::bench
