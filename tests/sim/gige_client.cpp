#include "tests/sim/gige_client.h"

#include <algorithm>

#include <arpa/inet.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

namespace sole::sim {

ArvClient::ArvClient(const std::string& name) {
  camera_ = arv_camera_new(name.c_str(), SOLE_ARV_OK);
}

ArvClient::~ArvClient() {
  if (stream_ != nullptr) Stop();
  g_clear_object(&camera_);
}

void ArvClient::Start(const std::string& source, int packet_size) {
  ArvGvDevice* device = ARV_GV_DEVICE(Device());
  arv_gv_device_set_stream_options(device, ARV_GV_STREAM_OPTION_PACKET_SOCKET_DISABLED);
  arv_gv_device_set_packet_size(device, packet_size, SOLE_ARV_OK);
  if (source.empty()) {
    arv_camera_clear_triggers(camera_, SOLE_ARV_OK);
  } else {
    arv_camera_set_trigger(camera_, source.c_str(), SOLE_ARV_OK);
  }
  stream_ = arv_camera_create_stream(camera_, nullptr, nullptr, SOLE_ARV_OK);
  ASSERT_NE(stream_, nullptr);
  g_object_set(stream_, "socket-buffer", ARV_GV_STREAM_SOCKET_BUFFER_FIXED, "socket-buffer-size",
               4 << 20, "packet-request-ratio", 1.0, "frame-retention", 1000000, nullptr);
  const guint payload = arv_camera_get_payload(camera_, SOLE_ARV_OK);
  for (int i = 0; i < 16; ++i) arv_stream_push_buffer(stream_, arv_buffer_new_allocate(payload));
  arv_camera_start_acquisition(camera_, SOLE_ARV_OK);
}

void ArvClient::Stop() {
  arv_camera_stop_acquisition(camera_, nullptr);
  g_clear_object(&stream_);
}

std::optional<ReceivedFrame> ArvClient::Next(int timeout_ms) {
  ArvBuffer* buffer =
      arv_stream_timeout_pop_buffer(stream_, static_cast<guint64>(timeout_ms) * 1000);
  if (buffer == nullptr) return {};
  ReceivedFrame frame;
  frame.status = arv_buffer_get_status(buffer);
  frame.id = arv_buffer_get_frame_id(buffer);
  frame.timestamp_ns = arv_buffer_get_timestamp(buffer);
  if (frame.status == ARV_BUFFER_STATUS_SUCCESS) {
    frame.image = ImageU8(arv_buffer_get_image_width(buffer), arv_buffer_get_image_height(buffer));
    std::size_t size = 0;
    const auto* data = static_cast<const std::uint8_t*>(arv_buffer_get_data(buffer, &size));
    std::copy_n(data, std::min(size, frame.image.pixels.size()), frame.image.pixels.begin());
  }
  arv_stream_push_buffer(stream_, buffer);
  return frame;
}

RawClient::RawClient() : socket_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in local{};
  local.sin_family = AF_INET;
  local.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  bind(socket_, reinterpret_cast<const sockaddr*>(&local), sizeof local);
}

RawClient::~RawClient() { close(socket_); }

int RawClient::Port() const {
  sockaddr_in local{};
  socklen_t size = sizeof local;
  getsockname(socket_, reinterpret_cast<sockaddr*>(&local), &size);
  return ntohs(local.sin_port);
}

void RawClient::Send(const std::string& address, int port,
                     std::span<const std::uint8_t> bytes) const {
  sockaddr_in to{};
  to.sin_family = AF_INET;
  to.sin_addr.s_addr = inet_addr(address.c_str());
  to.sin_port = htons(static_cast<std::uint16_t>(port));
  ASSERT_EQ(sendto(socket_, bytes.data(), bytes.size(), 0, reinterpret_cast<const sockaddr*>(&to),
                   sizeof to),
            static_cast<ssize_t>(bytes.size()));
}

void RawClient::Pulse(int bus_port, const TriggerPulse& pulse) const {
  Send("127.0.0.1", bus_port, Encode(pulse));
}

std::vector<std::uint8_t> RawClient::Receive(int timeout_ms) const {
  pollfd descriptor{socket_, POLLIN, 0};
  if (poll(&descriptor, 1, timeout_ms) <= 0) return {};
  std::vector<std::uint8_t> bytes(65536);
  const ssize_t count = recv(socket_, bytes.data(), bytes.size(), 0);
  bytes.resize(static_cast<std::size_t>(std::max<ssize_t>(count, 0)));
  return bytes;
}

std::vector<std::uint8_t> RawClient::Command(const std::string& address, std::uint16_t command,
                                             std::span<const std::uint32_t> words,
                                             bool acknowledged) {
  ++request_;
  const auto length = static_cast<std::uint16_t>(4 * words.size());
  const auto high = [](unsigned value) { return static_cast<std::uint8_t>(value >> 8); };
  const auto low = [](unsigned value) { return static_cast<std::uint8_t>(value); };
  std::vector<std::uint8_t> packet = {
      0x42,           acknowledged ? std::uint8_t{1} : std::uint8_t{0},
      high(command),  low(command),
      high(length),   low(length),
      high(request_), low(request_)};
  for (const std::uint32_t word : words) {
    for (const int shift : {24, 16, 8, 0})
      packet.push_back(static_cast<std::uint8_t>(word >> shift));
  }
  Send(address, 3956, packet);
  if (!acknowledged) return {};
  for (;;) {  // Late answers to earlier questions are passed over.
    const std::vector<std::uint8_t> answer = Receive(500);
    if (answer.size() < 8 || (answer[6] == high(request_) && answer[7] == low(request_)))
      return answer;
  }
}

int RawClient::WriteRegister(const std::string& address, std::uint32_t where, std::uint32_t value) {
  const std::uint32_t words[] = {where, value};
  const std::vector<std::uint8_t> ack = Command(address, 0x0082, words);
  return ack.size() < 8 ? -1 : ack[0] << 8 | ack[1];
}

std::optional<std::uint32_t> RawClient::ReadRegister(const std::string& address,
                                                     std::uint32_t where) {
  const std::uint32_t words[] = {where};
  const std::vector<std::uint8_t> ack = Command(address, 0x0080, words);
  if (ack.size() != 12 || ack[0] != 0 || ack[1] != 0) return {};
  return static_cast<std::uint32_t>(ack[8]) << 24 | static_cast<std::uint32_t>(ack[9]) << 16 |
         static_cast<std::uint32_t>(ack[10]) << 8 | ack[11];
}

void RawClient::FireAction(const std::string& address, std::uint32_t device_key,
                           std::uint32_t group_key, std::uint32_t group_mask) {
  const std::uint32_t words[] = {device_key, group_key, group_mask};
  Command(address, 0x0100, words, false);
}

}  // namespace sole::sim
