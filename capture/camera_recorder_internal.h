#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "capture/camera.h"
#include "capture/frame_matcher.h"
#include "capture/recorder.h"
#include "io/raw_file.h"

namespace sole::capture {

/// Stores one camera's frames: matches them to triggers on the camera's consumer thread and hands
/// them through a bounded queue to a writer thread, so that a slow disk costs dropped frames, which
/// are counted, and never stalls the stream.
class CameraRecorder {
 public:
  struct Options {
    std::filesystem::path path;
    int queue_frames = 32;
    std::int64_t period_ns = 0;
    std::function<void(const std::string&)> on_failure;  ///< the disk refused; called once
  };
  /// Creates the file and takes over the camera's handler. Throws Error if the file cannot be
  /// created.
  CameraRecorder(Camera& camera, const CameraSync& sync, const TriggerLog& log, Options options);
  ~CameraRecorder();
  CameraRecorder(const CameraRecorder&) = delete;
  CameraRecorder& operator=(const CameraRecorder&) = delete;

  /// Detaches from the camera, writes what is queued and closes the file. Throws Error if closing
  /// fails.
  void Finish();
  /// Triggers that have their frame, stored or dropped.
  std::int64_t Arrived() const { return arrived_.load(); }
  std::int64_t Stored() const { return stored_.load(); }
  std::int64_t LastArrivalNs() const { return last_arrival_ns_.load(); }
  /// What came of `fired` triggers; after Finish.
  CameraRecord Result(std::int64_t fired) const;

 private:
  struct Queued {
    io::RawRecordHeader header;
    std::vector<std::uint8_t> pixels;
  };
  void OnFrame(const CameraFrame& frame);
  void Enqueue(const CameraFrame& frame, const FrameMatch& match);
  void Write();
  void Join();

  Camera& camera_;
  const TriggerLog& log_;
  Options options_;
  FrameMatcher matcher_;
  io::RawFileWriter file_;

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Queued> queue_;
  std::vector<std::vector<std::uint8_t>> spare_;
  bool finishing_ = false;
  std::thread writer_;

  std::atomic<std::int64_t> arrived_{0};
  std::atomic<std::int64_t> stored_{0};
  std::atomic<std::int64_t> last_arrival_ns_{0};
  // Written by the consumer thread, read after Finish.
  CameraRecord counts_;
  double latency_sum_s_ = 0;
  // Written by the writer thread, read after Finish: trigger -> whole.
  std::map<std::int64_t, bool> stored_triggers_;
};

}  // namespace sole::capture
