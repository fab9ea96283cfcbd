#include "sim/gige/gvcp_server.h"

#include <algorithm>

#include "sim/gige/big_endian.h"

namespace sole::sim {
namespace {

constexpr std::size_t kHeaderSize = 8;
constexpr std::size_t kMaxData = 540;
constexpr std::uint8_t kCommandKey = 0x42;
constexpr std::uint8_t kAckFlag = 0x01, kScheduledActionFlag = 0x80;

enum Command : std::uint16_t {
  kDiscovery = 0x0002,
  kPacketResend = 0x0040,
  kReadRegister = 0x0080,
  kWriteRegister = 0x0082,
  kReadMemory = 0x0084,
  kWriteMemory = 0x0086,
  kAction = 0x0100,
};

struct Answer {
  GevStatus status = GevStatus::kSuccess;
  std::vector<std::uint8_t> data;
};

Answer ReadRegisters(std::span<const std::uint8_t> data, const Endpoint& from,
                     CameraDevice* device) {
  if (data.empty() || data.size() % 4 != 0 || data.size() > kMaxData)
    return {GevStatus::kInvalidParameter, {}};
  Answer answer{.data = std::vector<std::uint8_t>(data.size())};
  for (std::size_t at = 0; at < data.size(); at += 4) {
    answer.status = device->Read(from, Load32(data, at), std::span(answer.data).subspan(at, 4));
    if (answer.status != GevStatus::kSuccess) return {answer.status, {}};
  }
  return answer;
}

Answer WriteRegisters(std::span<const std::uint8_t> data, const Endpoint& from,
                      CameraDevice* device) {
  if (data.empty() || data.size() % 8 != 0) return {GevStatus::kInvalidParameter, {}};
  Answer answer{.data = std::vector<std::uint8_t>(4)};
  std::uint16_t written = 0;
  for (std::size_t at = 0; at < data.size() && answer.status == GevStatus::kSuccess; at += 8) {
    answer.status = device->Write(from, Load32(data, at), data.subspan(at + 4, 4));
    if (answer.status == GevStatus::kSuccess) ++written;
  }
  Store16(answer.data, 2, written);
  return answer;
}

Answer ReadMemory(std::span<const std::uint8_t> data, const Endpoint& from, CameraDevice* device) {
  if (data.size() < 8) return {GevStatus::kInvalidParameter, {}};
  const std::size_t count = Load16(data, 6);
  if (count > kMaxData - 4) return {GevStatus::kInvalidParameter, {}};
  Answer answer{.data = std::vector<std::uint8_t>(4 + count)};
  std::copy_n(data.begin(), 4, answer.data.begin());
  answer.status = device->Read(from, Load32(data, 0), std::span(answer.data).subspan(4));
  return answer;
}

Answer WriteMemory(std::span<const std::uint8_t> data, const Endpoint& from, CameraDevice* device) {
  if (data.size() < 8) return {GevStatus::kInvalidParameter, {}};
  Answer answer{.data = std::vector<std::uint8_t>(4)};
  answer.status = device->Write(from, Load32(data, 0), data.subspan(4));
  if (answer.status == GevStatus::kSuccess)
    Store16(answer.data, 2, static_cast<std::uint16_t>(data.size() - 4));
  return answer;
}

Answer Act(std::span<const std::uint8_t> data, std::uint8_t flags, CameraDevice* device) {
  if (data.size() < 12) return {GevStatus::kInvalidParameter, {}};
  if ((flags & kScheduledActionFlag) != 0) return {GevStatus::kNotImplemented, {}};
  return {device->OnAction({Load32(data, 0), Load32(data, 4), Load32(data, 8)}), {}};
}

Answer Discover(const CameraDevice& device) {
  Answer answer{.data = std::vector<std::uint8_t>(reg::kDiscoveryEnd)};
  device.ReadDiscovery(answer.data);
  return answer;
}

void Resend(std::span<const std::uint8_t> data, const Endpoint& from, CameraDevice* device) {
  if (data.size() < 12) return;
  device->OnResend(from, Load16(data, 2), Load32(data, 4) & 0xFFFFFF, Load32(data, 8) & 0xFFFFFF);
}

}  // namespace

std::vector<std::uint8_t> AnswerGvcp(std::span<const std::uint8_t> packet, const Endpoint& from,
                                     bool broadcast, CameraDevice* device) {
  if (packet.size() < kHeaderSize || packet[0] != kCommandKey) return {};
  const std::size_t length = Load16(packet, 4);
  const std::uint16_t command = Load16(packet, 2), id = Load16(packet, 6);
  const std::uint8_t flags = packet[1];
  if (packet.size() < kHeaderSize + length || id == 0) return {};
  const std::span<const std::uint8_t> data = packet.subspan(kHeaderSize, length);
  if (command % 2 != 0) return {};  // Commands are even; answering answers might never end.
  if (broadcast && command != kDiscovery && command != kAction) return {};

  Answer answer;
  switch (command) {
    case kDiscovery:
      answer = Discover(*device);
      break;
    case kPacketResend:
      Resend(data, from, device);
      return {};
    case kReadRegister:
      answer = ReadRegisters(data, from, device);
      break;
    case kWriteRegister:
      answer = WriteRegisters(data, from, device);
      break;
    case kReadMemory:
      answer = ReadMemory(data, from, device);
      break;
    case kWriteMemory:
      answer = WriteMemory(data, from, device);
      break;
    case kAction:
      answer = Act(data, flags, device);
      // Other groups' actions are none of this device's business.
      if (answer.status == GevStatus::kInvalidParameter) return {};
      break;
    default:
      answer.status = GevStatus::kNotImplemented;
      break;
  }
  if ((flags & kAckFlag) == 0) return {};
  std::vector<std::uint8_t> ack(kHeaderSize);
  Store16(ack, 0, static_cast<std::uint16_t>(answer.status));
  Store16(ack, 2, static_cast<std::uint16_t>(command + 1));
  Store16(ack, 4, static_cast<std::uint16_t>(answer.data.size()));
  Store16(ack, 6, id);
  ack.insert(ack.end(), answer.data.begin(), answer.data.end());
  return ack;
}

}  // namespace sole::sim
