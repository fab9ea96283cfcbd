#include "capture/camera.h"

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <mutex>
#include <thread>
#include <utility>

#include "capture/camera_internal.h"
#include "capture/discovery.h"
#include "capture/frame_id.h"
#include "capture/host_clock.h"

namespace sole::capture {
namespace {

constexpr int kBuffers = 24;
constexpr int kSocketBufferBytes = 8 << 20;
constexpr unsigned kFrameRetentionUs =
    400'000;  // paced frames of many cameras take tens of milliseconds
constexpr std::uint64_t kPopTimeoutUs = 50'000;

std::string Name(const CameraConfig& config) {
  return "camera " + config.serial + (config.address.empty() ? "" : " at " + config.address);
}

[[noreturn]] void ThrowNotFound(const CameraConfig& config) {
  const std::vector<FoundCamera> found = ListCameras();
  const auto same = std::find_if(found.begin(), found.end(), [&](const FoundCamera& camera) {
    return camera.serial == config.serial;
  });
  std::string message = "camera " + config.serial + " not found";
  if (!config.address.empty()) message += " at " + config.address;
  if (same != found.end()) {
    message += ": it answers at " + same->address + ", correct its address in the rig file";
  } else {
    message += ": cameras found: " + Describe(found) +
               "; is it powered and connected / is `sole sim serve` running?";
  }
  throw Error(message);
}

/// Device name that Aravis opens: the address, or the id that discovery gave for the serial.
std::string DeviceName(const CameraConfig& config) {
  if (!config.address.empty()) return config.address;
  for (const FoundCamera& camera : ListCameras()) {
    if (camera.serial == config.serial) return camera.id;
  }
  ThrowNotFound(config);
}

/// Serial number from the bootstrap registers, which every GigE Vision camera has.
std::string ReadSerial(ArvDevice* device) {
  std::array<char, 17> serial{};
  GErrorGuard error;
  arv_device_read_memory(device, 0xd8, 16, serial.data(), error.Out());
  error.Check("cannot read a camera's serial number");
  return serial.data();
}

void OnStreamEvent(void*, ArvStreamCallbackType type, ArvBuffer*) {
  // Raises Aravis' receiving thread; without the privilege it stays as it is.
  if (type == ARV_STREAM_CALLBACK_TYPE_INIT) setpriority(PRIO_PROCESS, 0, -10);
}

CameraFrame FrameFrom(ArvBuffer* buffer, std::int64_t frame_id) {
  CameraFrame frame;
  frame.host_time_ns = HostNowNs();
  frame.frame_id = frame_id;
  frame.device_time_ns = arv_buffer_get_timestamp(buffer);
  frame.width = arv_buffer_get_image_width(buffer);
  frame.height = arv_buffer_get_image_height(buffer);
  std::size_t size = 0;
  const auto* data = static_cast<const std::uint8_t*>(arv_buffer_get_data(buffer, &size));
  const std::size_t pixels =
      static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height);
  frame.complete = arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_SUCCESS && pixels <= size;
  frame.pixels = {data, std::min(size, pixels)};
  return frame;
}

bool HoldsImage(ArvBuffer* buffer) {
  const ArvBufferStatus status = arv_buffer_get_status(buffer);
  const bool filled =
      status == ARV_BUFFER_STATUS_SUCCESS || status == ARV_BUFFER_STATUS_MISSING_PACKETS ||
      status == ARV_BUFFER_STATUS_TIMEOUT || status == ARV_BUFFER_STATUS_WRONG_PACKET_ID;
  return filled && arv_buffer_get_payload_type(buffer) == ARV_BUFFER_PAYLOAD_TYPE_IMAGE;
}

}  // namespace

struct Camera::State {
  explicit State(const CameraConfig& c) : config(c) {}

  void Consume() {
    FrameIdUnwrapper ids;
    while (!stopping.load()) {
      ArvBuffer* buffer = arv_stream_timeout_pop_buffer(stream.get(), kPopTimeoutUs);
      if (buffer == nullptr) continue;
      if (HoldsImage(buffer)) {
        const CameraFrame frame = FrameFrom(buffer, ids.Unwrap(arv_buffer_get_frame_id(buffer)));
        const std::lock_guard lock(handler_mutex);
        if (handler) handler(frame);
      }
      arv_stream_push_buffer(stream.get(), buffer);
    }
  }

  CameraConfig config;
  GObjectPtr<ArvCamera> camera;
  GObjectPtr<ArvStream> stream;
  std::mutex handler_mutex;
  FrameHandler handler;
  std::atomic<bool> stopping{false};
  std::thread consumer;
  CameraStatistics last_statistics;
};

Camera::Camera(const CameraConfig& config) : state_(std::make_unique<State>(config)) {
  GErrorGuard error;
  state_->camera.reset(arv_camera_new(DeviceName(config).c_str(), error.Out()));
  if (!state_->camera) ThrowNotFound(config);
  ArvDevice* device = arv_camera_get_device(state_->camera.get());
  Require(ARV_IS_GV_DEVICE(device),
          Name(config) + " is not a GigE Vision camera: only those are supported");
  const std::string serial = ReadSerial(device);
  Require(serial == config.serial, "camera at " + config.address + " is " + serial + ", not " +
                                       config.serial +
                                       ": correct serial or address in the rig file");
  Require(arv_gv_device_is_controller(ARV_GV_DEVICE(device)),
          Name(config) +
              " is controlled by another program: close that program (or wait some seconds if it "
              "crashed)");
  arv_gv_device_set_stream_options(ARV_GV_DEVICE(device),
                                   ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  arv_gv_device_set_packet_size_adjustment(ARV_GV_DEVICE(device),
                                           ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
}

Camera::~Camera() {
  try {
    Stop();
  } catch (const std::exception&) {
    // The camera is gone; what is left to do is to free what is here.
  }
}

const CameraConfig& Camera::Config() const { return state_->config; }

std::vector<CameraSetting> Camera::ApplySettings(const std::string& trigger_source) {
  return WriteSettings(state_->camera.get(), state_->config, trigger_source);
}

void Camera::Configure(const std::string& trigger_source) {
  RequireSettings(state_->config, ApplySettings(trigger_source));
}

void Camera::Start() {
  Require(!state_->stream, Name(state_->config) + " is streaming already");
  GErrorGuard error;
  ArvCamera* camera = state_->camera.get();
  const guint payload = arv_camera_get_payload(camera, error.Out());
  error.Check(Name(state_->config) + " does not tell its frame size");
  state_->stream.reset(arv_camera_create_stream(camera, OnStreamEvent, nullptr, error.Out()));
  if (!state_->stream) error.Check(Name(state_->config) + " opens no stream");
  Require(state_->stream != nullptr, Name(state_->config) + " opens no stream");
  g_object_set(state_->stream.get(), "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED,
               "socket-buffer-size", kSocketBufferBytes, "frame-retention", kFrameRetentionUs,
               "packet-request-ratio", 1.0, nullptr);
  for (int i = 0; i < kBuffers; ++i) {
    arv_stream_push_buffer(state_->stream.get(), arv_buffer_new_allocate(payload));
  }
  arv_camera_start_acquisition(camera, error.Out());
  error.Check(Name(state_->config) + " does not start");
  state_->stopping = false;
  state_->consumer = std::thread([state = state_.get()] { state->Consume(); });
}

void Camera::SetHandler(FrameHandler handler) {
  const std::lock_guard lock(state_->handler_mutex);
  state_->handler = std::move(handler);
}

void Camera::Stop() {
  if (!state_->stream) return;
  state_->stopping = true;
  if (state_->consumer.joinable()) state_->consumer.join();
  GErrorGuard error;
  arv_camera_stop_acquisition(state_->camera.get(), error.Out());
  state_->last_statistics = Statistics();
  state_->stream.reset();
  error.Check(Name(state_->config) + " does not stop");
}

void Camera::SoftwareTrigger() {
  GErrorGuard error;
  arv_camera_software_trigger(state_->camera.get(), error.Out());
  error.Check(Name(state_->config) + " refuses the software trigger");
}

CameraStatistics Camera::Statistics() const {
  ArvStream* stream = state_->stream.get();
  if (stream == nullptr) return state_->last_statistics;
  const auto read = [&](const char* name) {
    return arv_stream_get_info_uint64_by_name(stream, name);
  };
  return {read("n_completed_buffers"),   read("n_failures"),        read("n_underruns"),
          read("n_missing_packets"),     read("n_resend_requests"), read("n_resent_packets"),
          read("n_resend_ratio_reached")};
}

bool Camera::InControl() const {
  return arv_gv_device_is_controller(ARV_GV_DEVICE(arv_camera_get_device(state_->camera.get()))) !=
         FALSE;
}

void RequireSettings(const CameraConfig& config, const std::vector<CameraSetting>& settings) {
  for (const CameraSetting& setting : settings) {
    Require(setting.ok, Name(config) + ": " + setting.name + " should be " + setting.wanted +
                            ", but the camera says '" + setting.got +
                            "': choose a value that it supports in the rig file");
  }
}

}  // namespace sole::capture
