#pragma once

#include <cstdint>
#include <string>

namespace sole::sim {

/// Who fires: the hardware line (trigger bus) or a broadcast GigE Vision action command.
enum class LoadTrigger { kLine, kAction };

struct CameraLoadOptions {
  int cameras = 20;
  int width = 1624;
  int height = 1236;
  double rate_hz = 10;
  int triggers = 600;
  int sets = 20;  ///< distinct sets of images, served in a cycle
  double packet_drop_probability = 0;
  int packet_size = 9000;
  LoadTrigger trigger = LoadTrigger::kLine;
  int net = 77;  ///< addresses 127.0.<net>.1 onwards
  double link_mbit_per_s = 1000;
  double frame_retention_s = 0.4;  ///< how long the clients wait for missing packets
};

/// What stock clients, one per camera, received. Every frame is one of the first five, or never
/// came.
struct CameraLoadResult {
  std::int64_t asked = 0;        ///< cameras x triggers; warm-ups do not count
  std::int64_t right = 0;        ///< whole, of the right set and camera, stamped with its trigger
  std::int64_t wrong_image = 0;  ///< checksum of another image, or of none
  std::int64_t wrong_stamp = 0;  ///< timestamp or frame id of another trigger
  std::int64_t incomplete = 0;   ///< packets missing in the end
  std::int64_t never_came = 0;
  std::int64_t packets_dropped = 0;  ///< by the fault
  std::int64_t packets_resent = 0;   ///< as the clients count them
  std::int64_t resends_refused = 0;
  double latest_s = 0;  ///< from a trigger to its last frame at the consumer, the worst
  double mean_latency_s = 0;
  double elapsed_s = 0;           ///< from the first trigger to the last frame
  double processor_s = 0;         ///< user and system time of the whole process meanwhile
  double server_processor_s = 0;  ///< the part of the server's threads
  double bytes_per_s = 0;         ///< of pixels asked
};

/// Serves distinct synthetic images (another for each set and camera) and takes them with Aravis as
/// the recorder does: a stream and a consumer per camera, which checks every byte by a checksum and
/// every timestamp. Fires three warm-ups, waits until every camera has answered them, then
/// `triggers` triggers at `rate_hz`. Throws Error if the cameras cannot be opened or do not warm
/// up.
CameraLoadResult RunCameraLoad(const CameraLoadOptions& options);

/// One line for people.
std::string Describe(const CameraLoadOptions& options, const CameraLoadResult& result);

}  // namespace sole::sim
