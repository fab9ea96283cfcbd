#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/rig_config.h"

namespace sole::capture {

/// A frame as it leaves the stream. `pixels` is valid as long as `hold` or a copy of it lives.
struct CameraFrame {
  std::int64_t frame_id = 0;         ///< unwrapped
  std::uint64_t device_time_ns = 0;  ///< camera clock; may be stale if not complete
  std::int64_t host_time_ns = 0;     ///< HostNowNs at arrival of the whole frame
  int width = 0;
  int height = 0;
  bool complete = false;                 ///< every packet arrived
  std::span<const std::uint8_t> pixels;  ///< width * height bytes, from a multiple of 4096
  /// The stream's buffer, which goes back to the camera when the last copy is gone: until then the
  /// camera has one buffer less. Let go before the camera stops.
  std::shared_ptr<const void> hold;
};

/// Called on the camera's consumer thread; must return well within a trigger period.
using FrameHandler = std::function<void(const CameraFrame&)>;

/// Counters of a camera's streams, reopened ones included.
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

/// What makes a camera expose.
struct TriggerInput {
  std::string source = "Line1";  ///< GenICam TriggerSource: Line1, Software or Action1
  std::uint32_t device_key = 0;  ///< of action commands
  std::uint32_t group_key = 0;
  std::uint32_t group_mask = 0;
};

/// What the control channel says of a camera that sends no frames.
enum class CameraLink {
  kOurs,    ///< answers, and this program controls it
  kFreed,   ///< answers, but forgot its controller: it restarted or gave up on us
  kSilent,  ///< does not answer
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

  /// Writes every setting (region, pixel format, exposure, gain, packets, trigger) and reads it
  /// back. Nothing is thrown for a setting that the camera refuses: see `ok`.
  std::vector<CameraSetting> ApplySettings(const TriggerInput& trigger);
  /// The same; throws Error naming camera, setting and both values at the first mismatch.
  void Configure(const TriggerInput& trigger);

  /// Starts streaming with `buffers` frames' worth of memory: what handlers may hold together, and
  /// about two seconds at 10 Hz for the stream. Frames go to the handler.
  void Start(int buffers = 24);
  /// Replaces the handler; returns when the old one is no longer running. Null discards frames.
  void SetHandler(FrameHandler handler);
  /// Stops streaming; the statistics stay.
  void Stop();
  /// Executes TriggerSoftware.
  void SoftwareTrigger();
  CameraStatistics Statistics() const;
  /// False once the camera stopped answering its control channel.
  bool InControl() const;
  /// Asks the control channel; may take seconds where nothing answers.
  CameraLink Probe();
  /// Opens the device anew after it was lost. The handler and the counts stay; Configure and Start
  /// are to follow. Throws Error, after which it may be tried again.
  void Reopen();
  /// Host time (HostNowNs) minus camera clock, to about a millisecond; empty if the camera cannot
  /// tell its time.
  std::optional<std::int64_t> HostMinusDeviceNs();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Throws Error for the first setting that is not ok.
void RequireSettings(const CameraConfig& config, const std::vector<CameraSetting>& settings);

}  // namespace sole::capture
