#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/fault.h"
#include "core/image.h"
#include "core/trigger_bus.h"

namespace sole::sim {

/// What is wrong with one simulated camera. Can be changed while the server runs.
struct CameraFaults {
  double packet_drop_probability = 0;  ///< per stream packet, resent ones included; [0, 1)
  bool dead = false;                   ///< answers nothing, sends nothing, is not discovered
  std::int64_t skip_frame_id_after =
      -1;  ///< leaves out one frame id after this many frames; -1 never
};

/// One simulated GigE Vision device.
struct ServedCamera {
  std::string serial{};   ///< 1 to 15 printable characters
  std::string address{};  ///< 127.x.y.z, its own
  int width = 1624;       ///< pixels of the sensor, 4 to 16384
  int height = 1236;
  double exposure_us = 1000;  ///< start value of ExposureTime
  double gain_db = 0;         ///< start value of Gain
  /// Error of the device clock against CLOCK_REALTIME when the server starts, and its drift, as
  /// long as PTP (feature GevIEEE1588) is not enabled.
  std::int64_t clock_offset_ns = 0;
  double clock_drift_ppm = 0;
};

/// The image camera `camera` (index into the served cameras) exposed at `pulse`; width x height of
/// that camera. Called from the cameras' sender threads at once, so it must be safe to call in
/// parallel. The image must stay unchanged until the server is gone: packets are sent and resent
/// from it. pulse.sequence <= 0 is a warm-up; software, action and free-running exposures count
/// from 1 in each acquisition and have kind 0.
using FrameProvider = std::function<const ImageU8&(int camera, const TriggerPulse& pulse)>;

struct CameraServerOptions {
  double link_mbit_per_s = 1000;       ///< speed of each camera's link: packets leave no faster
  std::uint16_t first_frame_id = 1;    ///< 1 to 65535; ids wrap from 65535 to 1
  std::uint64_t seed = 1;              ///< of the packet drops
  std::vector<CameraFaults> faults{};  ///< per camera; cameras beyond its end have none
  /// Faults by trigger number of the bus: those of docs/faults.md that show on the wire; others are
  /// none of the server's business.
  std::vector<FaultConfig> schedule{};
};

/// What a camera did since the server started.
struct ServedCameraStats {
  std::string serial;
  std::int64_t triggers = 0;          ///< exposures begun
  std::int64_t triggers_refused = 0;  ///< came while 64 were waiting
  std::int64_t frames_sent = 0;
  std::int64_t packets_sent = 0;       ///< resent ones included
  std::int64_t packets_dropped = 0;    ///< by the fault
  std::int64_t resends_requested = 0;  ///< packets
  std::int64_t resends_refused = 0;    ///< packets no longer in the ring of 8 frames
  std::int64_t send_errors = 0;
  std::string last_error;   ///< of the frame provider or the socket; empty if none
  bool controlled = false;  ///< an application holds control now
};

/// Serves GigE Vision cameras on loopback addresses: discovery, control and streaming as a stock
/// GigE Vision client expects them, hardware triggers from the simulated trigger bus
/// (core/trigger_bus.h). Runs from construction to destruction on its own threads: one for control,
/// one sender per camera. A bus pulse exposes every acquiring camera with TriggerSource Line1; the
/// frame's timestamp is the device clock at the pulse's scheduled_ns. The device clock is
/// CLOCK_REALTIME in ns unless ServedCamera says otherwise. Frames carry chunk data on request.
/// Gain and exposure do not change the pixels, which the provider rendered.
class CameraServer {
 public:
  /// `bus_port` is the UDP port on 127.0.0.1 that receives pulses; 0 takes a free one. Throws Error
  /// for impossible cameras or options and for addresses or ports in use.
  CameraServer(std::vector<ServedCamera> cameras, int bus_port, FrameProvider provider,
               CameraServerOptions options = {});
  ~CameraServer();
  CameraServer(const CameraServer&) = delete;
  CameraServer& operator=(const CameraServer&) = delete;

  int BusPort() const;
  std::vector<ServedCameraStats> Stats() const;
  /// Throws Error if there is no such camera or the probability is outside [0, 1).
  void SetFaults(int camera, const CameraFaults& faults);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace sole::sim
