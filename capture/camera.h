#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/rig_config.h"

namespace sole::capture {

/// A frame as it leaves the stream; `pixels` is valid during the call only.
struct CameraFrame {
  std::int64_t frame_id = 0;         ///< unwrapped
  std::uint64_t device_time_ns = 0;  ///< camera clock; may be stale if not complete
  std::int64_t host_time_ns = 0;     ///< HostNowNs at arrival of the whole frame
  int width = 0;
  int height = 0;
  bool complete = false;                 ///< every packet arrived
  std::span<const std::uint8_t> pixels;  ///< width * height bytes
};

/// Called on the camera's consumer thread; must return well within a trigger period.
using FrameHandler = std::function<void(const CameraFrame&)>;

/// Counters of one stream since Start.
struct CameraStatistics {
  std::uint64_t completed = 0;  ///< frames delivered whole
  std::uint64_t failures = 0;   ///< frames delivered with holes
  std::uint64_t underruns = 0;  ///< frames lost because no buffer was free
  std::uint64_t missing_packets = 0;
  std::uint64_t resend_requests = 0;
  std::uint64_t resent_packets = 0;
  std::uint64_t resend_ratio_reached = 0;  ///< frames given up because too much of them was missing
};

/// One setting as written and as the camera reports it afterwards.
struct CameraSetting {
  std::string name;
  std::string wanted;
  std::string got;
  bool ok = false;
};

/// An opened GigE Vision camera. Opening takes control; destruction gives it back.
class Camera {
 public:
  /// Opens the camera of this serial: at config.address if that is given, else wherever discovery
  /// finds it. Throws Error: not found (with the cameras that were), another serial at the address,
  /// controlled by another program.
  explicit Camera(const CameraConfig& config);
  ~Camera();
  Camera(const Camera&) = delete;
  Camera& operator=(const Camera&) = delete;

  const CameraConfig& Config() const;

  /// Writes every setting (size, pixel format, exposure, gain, packets, trigger on rising edges of
  /// `trigger_source`) and reads it back. Nothing is thrown for a setting that the camera refuses:
  /// see `ok`.
  std::vector<CameraSetting> ApplySettings(const std::string& trigger_source);
  /// The same; throws Error naming camera, setting and both values at the first mismatch.
  void Configure(const std::string& trigger_source);

  /// Starts streaming with buffers for about two seconds' worth of frames at 10 Hz. Frames go to
  /// the handler.
  void Start();
  /// Replaces the handler; returns when the old one is no longer running. Null discards frames.
  void SetHandler(FrameHandler handler);
  /// Stops streaming; the statistics stay.
  void Stop();
  /// Executes TriggerSoftware.
  void SoftwareTrigger();
  CameraStatistics Statistics() const;
  /// False once the camera stopped answering its control channel.
  bool InControl() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Throws Error for the first setting that is not ok.
void RequireSettings(const CameraConfig& config, const std::vector<CameraSetting>& settings);

}  // namespace sole::capture
