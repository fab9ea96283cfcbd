#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "capture/camera.h"
#include "capture/frame_matcher.h"
#include "capture/recorder.h"
#include "io/raw_file.h"

namespace sole::capture {

/// Stores one camera's frames: matches them to triggers on the camera's consumer thread and hands
/// them, in the stream's own buffers, through a bounded queue to a writer thread, so that a slow disk
/// costs dropped frames, which are counted, and never stalls the stream. With hold_frames the queue
/// is a ring in memory until Release says which trigger is the take's first.
class CameraRecorder {
 public:
  struct Options {
    std::filesystem::path path;
    int queue_frames = 32;
    int hold_frames = 0;  ///< > 0: the newest that many wait in memory for Release
    std::int64_t period_ns = 0;  ///< shortest time between triggers
    bool discard = false;        ///< checksums frames, stores none
    std::function<void(const std::string&)> on_failure;  ///< the disk refused; called once
    /// Every frame of a trigger as it arrives, on the consumer thread.
    std::function<void(const CameraFrame&, const FrameMatch&)> on_frame{};
    /// Every stored frame with the CRC-32 of its pixels, on the writer thread.
    std::function<void(const io::RawRecordHeader&, std::uint32_t)> on_stored{};
  };
  /// Creates the file and takes over the camera's handler. Throws Error if the file cannot be
  /// created.
  CameraRecorder(Camera& camera, const CameraSync& sync, const TriggerLog& log, Options options);
  ~CameraRecorder();
  CameraRecorder(const CameraRecorder&) = delete;
  CameraRecorder& operator=(const CameraRecorder&) = delete;

  /// Ends the hold: what was held from `first_trigger` on is written, and that trigger becomes
  /// number 1 of the file.
  void Release(std::int64_t first_trigger);
  /// The camera was opened anew: its ids count from anywhere, its clock is `host_minus_device_ns`
  /// behind the host's. Where that is not known the next whole frame tells, by its arrival.
  void Retie(std::optional<std::int64_t> host_minus_device_ns);
  /// Detaches from the camera, writes what is queued and closes the file. Throws Error if closing
  /// fails.
  void Finish();
  /// Triggers that have their frame, stored or dropped; since Release.
  std::int64_t Arrived() const { return arrived_.load(); }
  /// Frames between network and disk.
  int Queued() const;
  std::int64_t Stored() const { return stored_.load(); }
  std::int64_t LastArrivalNs() const { return last_arrival_ns_.load(); }
  /// What came of the take's `fired` triggers; after Finish.
  CameraRecord Result(std::int64_t fired) const;

 private:
  struct Frame {
    io::RawRecordHeader header;
    std::span<const std::uint8_t> pixels;
    std::shared_ptr<const void> hold;  ///< of the pixels
  };
  void OnFrame(const CameraFrame& frame);
  void Enqueue(const CameraFrame& frame, const FrameMatch& match);
  void Write();
  void Join();

  Camera& camera_;
  const TriggerLog& log_;
  Options options_;
  io::RawFileWriter file_;

  std::mutex match_mutex_;  ///< of what the consumer thread works on
  FrameMatcher matcher_;
  std::int64_t first_trigger_ = 1;
  bool clock_unknown_ = false;
  CameraRecord counts_;
  CameraStatistics before_;  ///< what the camera counted before the take
  double latency_sum_s_ = 0;

  mutable std::mutex mutex_;  ///< of the queue
  std::condition_variable changed_;
  std::deque<Frame> queue_;
  bool holding_ = false;
  bool finishing_ = false;
  std::thread writer_;

  std::atomic<std::int64_t> arrived_{0};
  std::atomic<std::int64_t> stored_{0};
  std::atomic<std::int64_t> last_arrival_ns_{0};
  // Written by the writer thread, read after Finish: trigger -> whole.
  std::map<std::int64_t, bool> stored_triggers_;
};

}  // namespace sole::capture
