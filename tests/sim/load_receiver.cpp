#include "tests/sim/load_receiver.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>

#include "core/error.h"

namespace sole::sim {
namespace {

std::uint64_t Mixed(std::uint64_t x) {
  x ^= x >> 33;
  x *= 0xFF51AFD7ED558CCDULL;
  x ^= x >> 33;
  return x;
}

/// Depends on every byte and its place; four lanes, so that memory is the limit.
std::uint64_t Checksum(const std::uint8_t* data, std::size_t size) {
  std::uint64_t lanes[4] = {1, 2, 3, 4};
  std::size_t at = 0;
  for (; at + 32 <= size; at += 32) {
    for (std::size_t lane = 0; lane < 4; ++lane) {
      std::uint64_t word = 0;
      std::memcpy(&word, data + at + 8 * lane, 8);
      lanes[lane] = (std::rotl(lanes[lane], 29) ^ word) * 0x9E3779B97F4A7C15ULL;
    }
  }
  std::uint64_t rest = size;
  for (; at < size; ++at) rest = rest * 257 + data[at];
  for (const std::uint64_t lane : lanes) rest = Mixed(rest ^ lane);
  return rest;
}

ImageU8 MakeImage(int width, int height, std::uint64_t seed) {
  ImageU8 image(width, height);
  std::uint64_t state = Mixed(seed + 1);
  for (std::size_t at = 0; at < image.pixels.size(); at += 8) {
    state += 0x9E3779B97F4A7C15ULL;
    const std::uint64_t word = Mixed(state);
    std::memcpy(image.pixels.data() + at, &word,
                std::min<std::size_t>(8, image.pixels.size() - at));
  }
  return image;
}

}  // namespace

std::int64_t LoadNowNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

ImageSets::ImageSets(const CameraLoadOptions& options) {
  for (int set = 0; set < options.sets; ++set) {
    auto& of_set = images.emplace_back();
    auto& sums = checksums.emplace_back();
    for (int camera = 0; camera < options.cameras; ++camera) {
      const auto seed = static_cast<std::uint64_t>(set * options.cameras + camera);
      of_set.push_back(MakeImage(options.width, options.height, seed));
      sums.push_back(Checksum(of_set.back().pixels.data(), of_set.back().pixels.size()));
    }
  }
}

LoadReceiver::LoadReceiver(const CameraLoadOptions& options, int index, const std::string& address,
                           const ImageSets& sets, const FireLog& fired)
    : options_(options), index_(static_cast<std::size_t>(index)), sets_(sets), fired_(fired) {
  camera_ = arv_camera_new(address.c_str(), nullptr);
  Require(camera_ != nullptr, "cannot open the camera at " + address);
  ArvGvDevice* device = ARV_GV_DEVICE(arv_camera_get_device(camera_));
  arv_gv_device_set_stream_options(device, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  arv_gv_device_set_packet_size(device, options.packet_size, nullptr);
  if (options.trigger == LoadTrigger::kAction) {
    arv_camera_set_integer(camera_, "ActionDeviceKey", kLoadDeviceKey, nullptr);
    arv_camera_set_integer(camera_, "ActionGroupKey", kLoadGroupKey, nullptr);
    arv_camera_set_integer(camera_, "ActionGroupMask", kLoadGroupMask, nullptr);
  }
  arv_camera_set_trigger(camera_, options.trigger == LoadTrigger::kAction ? "Action1" : "Line1",
                         nullptr);
  stream_ = arv_camera_create_stream(camera_, nullptr, nullptr, nullptr);
  Require(stream_ != nullptr, "cannot open the stream of " + address);
  g_object_set(stream_, "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size",
               8 << 20, "frame-retention",
               static_cast<unsigned>(std::lround(1e6 * options.frame_retention_s)),
               "packet-request-ratio", 1.0, nullptr);
  const guint payload = arv_camera_get_payload(camera_, nullptr);
  for (int i = 0; i < 24; ++i) arv_stream_push_buffer(stream_, arv_buffer_new_allocate(payload));
  arv_camera_start_acquisition(camera_, nullptr);
  thread_ = std::thread([this] { Run(); });
}

LoadReceiver::~LoadReceiver() {
  Stop();
  arv_camera_stop_acquisition(camera_, nullptr);
  g_object_unref(stream_);
  g_object_unref(camera_);
}

void LoadReceiver::Stop() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

std::int64_t LoadReceiver::Resent() const {
  return static_cast<std::int64_t>(arv_stream_get_info_uint64_by_name(stream_, "n_resent_packets"));
}

void LoadReceiver::Run() {
  while (!stop_) {
    ArvBuffer* buffer = arv_stream_timeout_pop_buffer(stream_, 50000);
    if (buffer == nullptr) continue;
    Take(buffer);
    arv_stream_push_buffer(stream_, buffer);
  }
}

void LoadReceiver::Take(ArvBuffer* buffer) {
  const std::int64_t now = LoadNowNs();
  const auto trigger = static_cast<std::int64_t>(arv_buffer_get_frame_id(buffer)) - kLoadWarmUps;
  if (trigger < 1) {
    ++warm_ups_;
    return;
  }
  ++counted_;
  if (arv_buffer_get_status(buffer) != ARV_BUFFER_STATUS_SUCCESS) {
    ++result_.incomplete;
    return;
  }
  const std::int64_t fired = trigger <= options_.triggers ? fired_.At(trigger) : 0;
  const auto stamp = static_cast<std::int64_t>(arv_buffer_get_timestamp(buffer));
  // The line's frames carry the pulse's time; an action is stamped when it arrives.
  const bool line = options_.trigger == LoadTrigger::kLine;
  const bool stamped = fired != 0 && (line ? stamp == fired : stamp >= fired && stamp <= now);
  if (!stamped || trigger <= last_) {
    ++result_.wrong_stamp;
    return;
  }
  last_ = trigger;
  std::size_t size = 0;
  const auto* data = static_cast<const std::uint8_t*>(arv_buffer_get_data(buffer, &size));
  // Actions count from the start of the acquisition, warm-ups included.
  const std::size_t set = sets_.SetOf(line ? trigger : trigger + kLoadWarmUps);
  if (Checksum(data, size) != sets_.checksums[set][index_]) {
    ++result_.wrong_image;
    return;
  }
  ++result_.right;
  const double latency = 1e-9 * static_cast<double>(LoadNowNs() - fired);
  result_.latest_s = std::max(result_.latest_s, latency);
  result_.mean_latency_s += latency;
}

}  // namespace sole::sim
