#include "capture/camera.h"

#include <sys/resource.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <mutex>
#include <new>
#include <thread>
#include <utility>

#include "capture/camera_internal.h"
#include "capture/discovery.h"
#include "capture/frame_id.h"
#include "capture/host_clock.h"

namespace sole::capture {
namespace {

constexpr std::size_t kBufferAlignment = 4096;
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
  if (arv_buffer_get_n_parts(buffer) > 0) {  // without its leader packet a buffer is no image
    frame.width = arv_buffer_get_image_width(buffer);
    frame.height = arv_buffer_get_image_height(buffer);
  }
  std::size_t size = 0;
  const auto* data = static_cast<const std::uint8_t*>(arv_buffer_get_data(buffer, &size));
  const std::size_t pixels =
      static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height);
  frame.complete = arv_buffer_get_status(buffer) == ARV_BUFFER_STATUS_SUCCESS && pixels <= size;
  frame.pixels = {data, std::min(size, pixels)};
  return frame;
}

GObjectPtr<ArvCamera> OpenDevice(const CameraConfig& config) {
  GErrorGuard error;
  GObjectPtr<ArvCamera> camera(arv_camera_new(DeviceName(config).c_str(), error.Out()));
  if (!camera) ThrowNotFound(config);
  ArvDevice* device = arv_camera_get_device(camera.get());
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
  return camera;
}

CameraStatistics StatisticsOf(ArvStream* stream) {
  const auto read = [&](const char* name) {
    return arv_stream_get_info_uint64_by_name(stream, name);
  };
  return {read("n_completed_buffers"),   read("n_failures"),        read("n_underruns"),
          read("n_missing_packets"),     read("n_resend_requests"), read("n_resent_packets"),
          read("n_resend_ratio_reached")};
}

CameraStatistics Sum(const CameraStatistics& a, const CameraStatistics& b) {
  return {a.completed + b.completed,
          a.failures + b.failures,
          a.underruns + b.underruns,
          a.missing_packets + b.missing_packets,
          a.resend_requests + b.resend_requests,
          a.resent_packets + b.resent_packets,
          a.resend_ratio_reached + b.resend_ratio_reached};
}

std::uint32_t BigEndian32(const std::array<std::uint8_t, 8>& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | bytes[at + i];
  return value;
}

/// Memory for one frame that a disk can take without a copy: at a page, zeroed so that no page is
/// missing when the frames come.
ArvBuffer* AllocateBuffer(std::size_t payload) {
  const std::size_t size = (payload + kBufferAlignment - 1) / kBufferAlignment * kBufferAlignment;
  void* memory = std::aligned_alloc(kBufferAlignment, size);
  if (memory == nullptr) throw std::bad_alloc();
  std::memset(memory, 0, size);
  return arv_buffer_new_full(payload, memory, memory, std::free);
}

/// Gives the buffer back to its stream when the last copy is gone.
std::shared_ptr<const void> Hold(ArvStream* stream, ArvBuffer* buffer) {
  g_object_ref(stream);
  return {buffer, [stream, buffer](const void*) {
            arv_stream_push_buffer(stream, buffer);
            g_object_unref(stream);
          }};
}

bool HoldsImage(ArvBuffer* buffer) {
  const ArvBufferStatus status = arv_buffer_get_status(buffer);
  const bool filled =
      status == ARV_BUFFER_STATUS_SUCCESS || status == ARV_BUFFER_STATUS_MISSING_PACKETS ||
      status == ARV_BUFFER_STATUS_TIMEOUT || status == ARV_BUFFER_STATUS_WRONG_PACKET_ID;
  // Without its leader, a frame of lost packets has neither size nor part.
  return filled && arv_buffer_get_payload_type(buffer) == ARV_BUFFER_PAYLOAD_TYPE_IMAGE &&
         arv_buffer_get_n_parts(buffer) > 0 &&
         arv_buffer_get_part_data_type(buffer, 0) == ARV_BUFFER_PART_DATA_TYPE_2D_IMAGE;
}

}  // namespace

struct Camera::State {
  explicit State(const CameraConfig& c) : config(c) {}

  void Consume() {
    FrameIdUnwrapper ids;
    while (!stopping.load()) {
      ArvBuffer* buffer = arv_stream_timeout_pop_buffer(stream.get(), kPopTimeoutUs);
      if (buffer == nullptr) continue;
      const std::shared_ptr<const void> hold = Hold(stream.get(), buffer);
      if (!HoldsImage(buffer)) continue;
      CameraFrame frame = FrameFrom(buffer, ids.Unwrap(arv_buffer_get_frame_id(buffer)));
      frame.hold = hold;
      const std::lock_guard lock(handler_mutex);
      if (handler) handler(frame);
    }
  }

  /// The device, kept open while the caller has it. Throws Error while Reopen is at work.
  GObjectPtr<ArvCamera> Device() const {
    const std::lock_guard lock(device_mutex);
    Require(camera != nullptr, Name(config) + " is not open");
    return GObjectPtr<ArvCamera>(static_cast<ArvCamera*>(g_object_ref(camera.get())));
  }

  CameraConfig config;
  mutable std::mutex device_mutex;  ///< of the two pointers, which Reopen replaces
  GObjectPtr<ArvCamera> camera;
  GObjectPtr<ArvStream> stream;
  CameraStatistics earlier;  ///< of streams that are closed
  std::mutex handler_mutex;
  FrameHandler handler;
  std::atomic<bool> stopping{false};
  std::thread consumer;
};

Camera::Camera(const CameraConfig& config)
    : state_(std::make_unique<State>(config)) {
  state_->camera = OpenDevice(config);
}

Camera::~Camera() {
  try {
    Stop();
  } catch (const std::exception&) {
    // The camera is gone; what is left to do is to free what is here.
  }
}

const CameraConfig& Camera::Config() const { return state_->config; }

std::vector<CameraSetting> Camera::ApplySettings(const TriggerInput& trigger) {
  return WriteSettings(state_->camera.get(), state_->config, trigger);
}

void Camera::Configure(const TriggerInput& trigger) {
  RequireSettings(state_->config, ApplySettings(trigger));
}

void Camera::Start(int buffers) {
  Require(!state_->stream, Name(state_->config) + " is streaming already");
  GErrorGuard error;
  ArvCamera* camera = state_->camera.get();
  const guint payload = arv_camera_get_payload(camera, error.Out());
  error.Check(Name(state_->config) + " does not tell its frame size");
  GObjectPtr<ArvStream> stream(
      arv_camera_create_stream(camera, OnStreamEvent, nullptr, error.Out()));
  if (!stream) error.Check(Name(state_->config) + " opens no stream");
  Require(stream != nullptr, Name(state_->config) + " opens no stream");
  g_object_set(stream.get(), "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED,
               "socket-buffer-size", kSocketBufferBytes, "frame-retention", kFrameRetentionUs,
               "packet-request-ratio", 1.0, nullptr);
  for (int i = 0; i < buffers; ++i) arv_stream_push_buffer(stream.get(), AllocateBuffer(payload));
  arv_camera_start_acquisition(camera, error.Out());
  error.Check(Name(state_->config) + " does not start");
  {
    const std::lock_guard lock(state_->device_mutex);
    state_->stream = std::move(stream);
  }
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
  GObjectPtr<ArvStream> stream;
  {
    const std::lock_guard lock(state_->device_mutex);
    state_->earlier = Sum(state_->earlier, StatisticsOf(state_->stream.get()));
    stream = std::move(state_->stream);
  }
  stream.reset();  // joins Aravis' thread: not under the lock
  error.Check(Name(state_->config) + " does not stop");
}

void Camera::Reopen() {
  try {
    Stop();
  } catch (const Error&) {
    // It went away: nothing that could be stopped.
  }
  GObjectPtr<ArvCamera> old;
  {
    const std::lock_guard lock(state_->device_mutex);
    old = std::move(state_->camera);
  }
  old.reset();  // gives the control channel back first, which may take seconds
  GObjectPtr<ArvCamera> camera = OpenDevice(state_->config);
  const std::lock_guard lock(state_->device_mutex);
  state_->camera = std::move(camera);
}

CameraLink Camera::Probe() {
  constexpr std::uint64_t kControlRegister = 0x0A00;
  constexpr std::uint32_t kControlBits = 0x3;
  if (!state_->camera) return CameraLink::kFreed;
  guint32 control = 0;
  GErrorGuard error;
  ArvDevice* device = arv_camera_get_device(state_->camera.get());
  if (!arv_device_read_register(device, kControlRegister, &control, error.Out())) {
    return CameraLink::kSilent;
  }
  return (control & kControlBits) != 0 && InControl() ? CameraLink::kOurs : CameraLink::kFreed;
}

std::optional<std::int64_t> Camera::HostMinusDeviceNs() {
  // Bootstrap registers that GigE Vision prescribes: tick frequency, latch, latched value.
  constexpr std::uint64_t kFrequency = 0x093C, kLatch = 0x0944, kLatched = 0x0948;
  constexpr int kTries = 5;
  constexpr std::uint32_t kLatchNow = 2;
  ArvDevice* device = arv_camera_get_device(state_->camera.get());
  std::array<std::uint8_t, 8> bytes{};
  if (!arv_device_read_memory(device, kFrequency, 8, bytes.data(), nullptr)) return {};
  const double hz = BigEndian32(bytes, 0) * 4294967296.0 + BigEndian32(bytes, 4);
  if (!(hz > 0)) return {};
  std::optional<std::int64_t> offset;
  std::int64_t shortest = std::numeric_limits<std::int64_t>::max();
  for (int i = 0; i < kTries; ++i) {
    const std::int64_t before = HostNowNs();
    if (!arv_device_write_register(device, kLatch, kLatchNow, nullptr)) return {};
    const std::int64_t after = HostNowNs();
    if (!arv_device_read_memory(device, kLatched, 8, bytes.data(), nullptr)) return {};
    const std::uint64_t ticks =
        static_cast<std::uint64_t>(BigEndian32(bytes, 0)) << 32 | BigEndian32(bytes, 4);
    if (ticks == 0) return {};
    if (after - before >= shortest) continue;
    shortest = after - before;
    const double ns_per_tick = 1e9 / hz;
    const std::int64_t device_ns = hz == 1e9
                                       ? static_cast<std::int64_t>(ticks)
                                       : std::llround(static_cast<double>(ticks) * ns_per_tick);
    offset = before + shortest / 2 - device_ns;
  }
  return offset;
}

void Camera::SoftwareTrigger() {
  const GObjectPtr<ArvCamera> camera = state_->Device();
  GErrorGuard error;
  arv_camera_software_trigger(camera.get(), error.Out());
  error.Check(Name(state_->config) + " refuses the software trigger");
}

CameraStatistics Camera::Statistics() const {
  const std::lock_guard lock(state_->device_mutex);
  if (!state_->stream) return state_->earlier;
  return Sum(state_->earlier, StatisticsOf(state_->stream.get()));
}

bool Camera::InControl() const {
  const std::lock_guard lock(state_->device_mutex);
  return state_->camera != nullptr && arv_gv_device_is_controller(ARV_GV_DEVICE(
                                          arv_camera_get_device(state_->camera.get()))) != FALSE;
}

void RequireSettings(const CameraConfig& config, const std::vector<CameraSetting>& settings) {
  for (const CameraSetting& setting : settings) {
    Require(setting.ok, Name(config) + ": " + setting.name + " should be " + setting.wanted +
                            ", but the camera says '" + setting.got +
                            "': choose a value that it supports in the rig file");
  }
}

}  // namespace sole::capture
