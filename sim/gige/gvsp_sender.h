#pragma once

#include <array>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <random>
#include <thread>
#include <vector>

#include "sim/camera_server.h"
#include "sim/gige/gvsp_packet.h"
#include "sim/gige/udp_socket.h"

namespace sole::sim {

struct GvspSenderOptions {
  std::uint32_t address = 0;  ///< the device's own, host order
  int camera = 0;             ///< index handed to the provider
  double link_mbit_per_s = 1000;
  std::uint16_t first_frame_id = 1;
  std::uint64_t seed = 1;
};

/// The stream channel of one device: a thread that exposes, sends, paces and resends. All calls
/// return at once and may come from any thread.
class GvspSender {
 public:
  GvspSender(const GvspSenderOptions& options, FrameProvider provider);
  ~GvspSender();
  GvspSender(const GvspSender&) = delete;
  GvspSender& operator=(const GvspSender&) = delete;

  std::uint16_t SourcePort() const { return socket_.Local().port; }
  /// Queues an exposure; it never replaces a waiting one. Refused and counted when 64 wait.
  bool Expose(const TriggerPulse& pulse, const StreamSettings& settings);
  void Resend(std::uint16_t frame_id, std::uint32_t first_packet, std::uint32_t last_packet);
  void SendTestPacket(const StreamSettings& settings);
  /// Forgets waiting exposures; the frame being sent is completed.
  void Clear();
  /// A newly opened stream channel counts frames from the first id.
  void RestartFrameIds();
  void SetFaults(const CameraFaults& faults);
  /// Whether all packets vanish, as on a dead link.
  void SetSilent(bool silent);

  bool Dead() const;
  bool Exposing() const;
  bool Idle() const;
  /// Without serial and control.
  ServedCameraStats Stats() const;

 private:
  using Clock = std::chrono::steady_clock;
  using Lock = std::unique_lock<std::mutex>;
  struct Exposure {
    TriggerPulse pulse;
    StreamSettings settings;
    Clock::time_point begin;
  };
  struct ResendRequest {
    std::uint16_t frame_id = 0;
    std::uint32_t first = 0;
    std::uint32_t last = 0;
  };

  void Run();
  void SendFrame(const Exposure& exposure, Lock* lock);
  void SendPackets(const SentFrame& frame, std::uint32_t first, std::uint32_t count,
                   GevStatus status, Lock* lock);
  void Transmit(std::vector<GvspPacket> packets, const StreamSettings& settings, Lock* lock);
  void ServeRequests(Lock* lock);
  void ServeResend(const ResendRequest& request, Lock* lock);
  /// Serves requests until `deadline`; false when the sender stops.
  bool WaitUntil(Clock::time_point deadline, Lock* lock);
  std::uint16_t TakeFrameId(const FrameFaults& faults);

  const GvspSenderOptions options_;
  const FrameProvider provider_;
  UdpSocket socket_;

  mutable std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  bool exposing_ = false;
  bool sending_ = false;
  std::deque<Exposure> exposures_;
  std::deque<ResendRequest> resends_;
  std::deque<StreamSettings> test_packets_;
  CameraFaults faults_;
  ServedCameraStats stats_;
  std::uint16_t next_frame_id_;
  std::uint16_t last_frame_id_ = 0;  ///< 0 before the first
  bool silent_ = false;

  // Used by the thread only.
  std::array<SentFrame, 8> ring_;
  std::size_t ring_next_ = 0;
  std::mt19937_64 random_;
  bool do_not_fragment_ = false;

  std::thread thread_;
};

}  // namespace sole::sim
