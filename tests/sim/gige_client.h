#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <arv.h>
#include <gtest/gtest.h>

#include "core/image.h"
#include "core/trigger_bus.h"

namespace sole::sim {

/// Turns a GError into a test failure.
class CheckedError {
 public:
  explicit CheckedError(const char* what) : what_(what) {}
  ~CheckedError() {
    if (error_ == nullptr) return;
    ADD_FAILURE() << what_ << ": " << error_->message;
    g_error_free(error_);
  }
  CheckedError(const CheckedError&) = delete;
  CheckedError& operator=(const CheckedError&) = delete;
  operator GError**() { return &error_; }

 private:
  const char* what_;
  GError* error_ = nullptr;
};
#define SOLE_ARV_OK ::sole::sim::CheckedError(__FILE__ ":" G_STRINGIFY(__LINE__))

struct ReceivedFrame {
  ArvBufferStatus status = ARV_BUFFER_STATUS_UNKNOWN;
  std::uint64_t id = 0;
  std::uint64_t timestamp_ns = 0;
  ImageU8 image;
};

/// A stock Aravis client of one camera.
class ArvClient {
 public:
  explicit ArvClient(const std::string& name);
  ~ArvClient();
  ArvClient(const ArvClient&) = delete;
  ArvClient& operator=(const ArvClient&) = delete;

  ArvCamera* Camera() const { return camera_; }
  ArvDevice* Device() const { return arv_camera_get_device(camera_); }
  ArvStream* Stream() const { return stream_; }
  /// Opens the stream with 16 buffers and starts acquisition; `source` empty leaves triggers off.
  void Start(const std::string& source, int packet_size = 9000);
  void Stop();
  /// The next frame; empty after `timeout_ms`.
  std::optional<ReceivedFrame> Next(int timeout_ms = 5000);

 private:
  ArvCamera* camera_ = nullptr;
  ArvStream* stream_ = nullptr;
};

/// A bare UDP socket on 127.0.0.1 that speaks GVCP and fires bus pulses.
class RawClient {
 public:
  RawClient();
  ~RawClient();
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  void Send(const std::string& address, int port, std::span<const std::uint8_t> bytes) const;
  void Pulse(int bus_port, const TriggerPulse& pulse) const;
  std::vector<std::uint8_t> Receive(int timeout_ms) const;
  /// Status word of the acknowledgement; -1 if none came.
  int WriteRegister(const std::string& address, std::uint32_t where, std::uint32_t value);
  std::optional<std::uint32_t> ReadRegister(const std::string& address, std::uint32_t where);
  void FireAction(const std::string& address, std::uint32_t device_key, std::uint32_t group_key,
                  std::uint32_t group_mask);
  int Port() const;

 private:
  std::vector<std::uint8_t> Command(const std::string& address, std::uint16_t command,
                                    std::span<const std::uint32_t> words, bool acknowledged = true);
  int socket_ = -1;
  std::uint16_t request_ = 0;
};

}  // namespace sole::sim
