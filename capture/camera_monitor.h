#pragma once

#include <cstdint>
#include <map>
#include <mutex>
#include <optional>
#include <vector>

#include "capture/camera.h"
#include "capture/frame_matcher.h"
#include "capture/image_sample.h"
#include "core/image.h"

namespace sole::capture {

/// Rate of a camera's clock against the host's, from the frames of one take.
struct ClockRate {
  double ppm = 0;  ///< positive: the camera's clock runs fast
  double sd_ppm = 0;
  int frames = 0;
};

/// Least squares of device time over host time, one point a frame; constant memory.
class ClockFit {
 public:
  void Add(std::int64_t host_ns, std::uint64_t device_ns);
  /// Empty with fewer than five frames.
  std::optional<ClockRate> Rate() const;

 private:
  int count_ = 0;
  std::int64_t first_host_ns_ = 0;
  std::int64_t first_offset_ns_ = 0;
  double x_ = 0, y_ = 0, xx_ = 0, xy_ = 0, yy_ = 0;  ///< sums; seconds and microseconds
};

/// Looks at every frame of one camera while it is recorded. OnFrame belongs to the camera's
/// consumer thread, everything else may be called from any thread.
class CameraMonitor {
 public:
  void OnFrame(const CameraFrame& frame, const FrameMatch& match);
  /// The camera's clock was set anew.
  void RestartClock();
  /// Forgets what came before the take's first trigger.
  void Restart();

  struct Snapshot {
    ImageSample sample;         ///< of the newest whole frame, without its levels
    double latency_s = 0;       ///< of the newest frame, edge to whole frame
    double residual_s = 0;      ///< its camera time against its edge
    bool foot = false;          ///< in the newest frame
    std::int64_t foot_frames = 0;
    std::int64_t whole_frames = 0;
  };
  Snapshot Now() const;
  double MedianLatencyS() const;
  std::optional<ClockRate> Clock() const;
  /// Trigger -> how much its image differs from that of the trigger before, same kind of light.
  std::map<std::int64_t, double> Motion() const;

  /// Copies whole frames, at most one in `interval_s`, for those who look on; 0 stops that.
  void KeepPictures(double interval_s);
  /// The newest kept one; empty if there is none.
  ImageU8 Picture() const;

 private:
  mutable std::mutex mutex_;
  Snapshot now_;
  std::vector<float> latencies_s_;
  ClockFit clock_;
  std::map<std::int64_t, double> motion_;
  struct Last {
    std::int64_t trigger = 0;
    ImageSample sample;
  };
  std::map<ExposureKind, Last> last_;
  std::int64_t picture_interval_ns_ = 0;
  std::int64_t picture_time_ns_ = 0;
  ImageU8 picture_;
};

}  // namespace sole::capture
