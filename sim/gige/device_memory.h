#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "sim/gige/feature_table.h"

namespace sole::sim {

/// GigE Vision status codes used here.
enum class GevStatus : std::uint16_t {
  kSuccess = 0x0000,
  kPacketResend = 0x0100,
  kNotImplemented = 0x8001,
  kInvalidParameter = 0x8002,
  kInvalidAddress = 0x8003,
  kWriteProtect = 0x8004,
  kBadAlignment = 0x8005,
  kAccessDenied = 0x8006,
  kPacketUnavailable = 0x800C,
};

/// The address space of one device: registers from 0 to reg::kMemoryEnd and the GenICam XML at
/// reg::kXml. Checks what an application writes against the feature table; has no side effects.
class DeviceMemory {
 public:
  explicit DeviceMemory(const ServedCamera& camera);

  GevStatus Read(std::uint32_t address, std::span<std::uint8_t> bytes) const;
  /// Whether an application may write `bytes` at `address`.
  GevStatus CheckWrite(std::uint32_t address, std::span<const std::uint8_t> bytes,
                       bool acquiring) const;

  std::uint32_t Get32(std::uint32_t address) const;
  void Set32(std::uint32_t address, std::uint32_t value);
  std::uint64_t Get64(std::uint32_t address) const;
  void Set64(std::uint32_t address, std::uint64_t value);
  double GetFloat(std::uint32_t address) const;
  void SetFloat(std::uint32_t address, double value);
  void SetText(std::uint32_t address, std::uint32_t length, const std::string& text);
  void SetBytes(std::uint32_t address, std::span<const std::uint8_t> bytes);

 private:
  GevStatus CheckFeature(const Feature& feature, std::uint32_t address,
                         std::span<const std::uint8_t> bytes, bool acquiring) const;

  std::vector<Feature> features_;
  std::vector<std::uint8_t> registers_;
  std::vector<std::uint8_t> xml_;
};

}  // namespace sole::sim
