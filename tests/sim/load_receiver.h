#pragma once

#include <atomic>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include <arv.h>

#include "core/image.h"
#include "tests/sim/camera_load.h"

namespace sole::sim {

inline constexpr int kLoadWarmUps = 3;
/// Of the action command that fires.
inline constexpr std::uint32_t kLoadDeviceKey = 0x50304C45, kLoadGroupKey = 7, kLoadGroupMask = 2;

/// Nanoseconds of CLOCK_REALTIME.
std::int64_t LoadNowNs();

/// Synthetic images, all different: images[set][camera], and their checksums.
struct ImageSets {
  explicit ImageSets(const CameraLoadOptions& options);
  /// `number` counts exposures from 1; warm-ups are 0 and less.
  std::size_t SetOf(std::int64_t number) const {
    const auto count = static_cast<std::int64_t>(images.size());
    return static_cast<std::size_t>(((number - 1) % count + count) % count);
  }
  std::vector<std::vector<ImageU8>> images;
  std::vector<std::vector<std::uint64_t>> checksums;
};

/// When each trigger fired, from the first warm-up on.
class FireLog {
 public:
  explicit FireLog(int triggers) : times_ns_(static_cast<std::size_t>(triggers + kLoadWarmUps)) {}
  void Set(std::int64_t trigger, std::int64_t time_ns) { times_ns_[Index(trigger)] = time_ns; }
  std::int64_t At(std::int64_t trigger) const { return times_ns_[Index(trigger)]; }

 private:
  std::size_t Index(std::int64_t trigger) const {
    return static_cast<std::size_t>(trigger + kLoadWarmUps - 1);
  }
  std::vector<std::atomic<std::int64_t>> times_ns_;
};

/// One camera's stream and the thread that takes and checks its frames.
class LoadReceiver {
 public:
  /// Opens the camera and starts its acquisition. What it refers to must outlive it. Throws Error.
  LoadReceiver(const CameraLoadOptions& options, int index, const std::string& address,
               const ImageSets& sets, const FireLog& fired);
  ~LoadReceiver();
  LoadReceiver(const LoadReceiver&) = delete;
  LoadReceiver& operator=(const LoadReceiver&) = delete;

  void Stop();
  int WarmUps() const { return warm_ups_; }
  std::int64_t Counted() const { return counted_; }
  std::int64_t Resent() const;
  /// Only after Stop; mean_latency_s is a sum.
  const CameraLoadResult& Result() const { return result_; }

 private:
  void Run();
  void Take(ArvBuffer* buffer);

  const CameraLoadOptions& options_;
  const std::size_t index_;
  const ImageSets& sets_;
  const FireLog& fired_;
  ArvCamera* camera_ = nullptr;
  ArvStream* stream_ = nullptr;
  std::atomic<bool> stop_{false};
  std::atomic<int> warm_ups_{0};
  std::atomic<std::int64_t> counted_{0};
  std::int64_t last_ = 0;
  CameraLoadResult result_;
  std::thread thread_;
};

}  // namespace sole::sim
