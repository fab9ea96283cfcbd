#include "sim/gige/device_memory.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include <arpa/inet.h>
#include <fmt/format.h>

#include "sim/gige/big_endian.h"
#include "sim/gige/device_clock.h"
#include "sim/gige/genicam_xml.h"

namespace sole::sim {
namespace {

constexpr std::uint32_t kPad = 4;  // The XML is read in words.

// Concatenated commands, WRITEMEM, PACKETRESEND, ACTION, serial number and user-defined name
// registers.
constexpr std::uint32_t kCapabilityBits =
    1U << 0 | 1U << 1 | 1U << 2 | 1U << 6 | 1U << 30 | 1U << 31;

}  // namespace

DeviceMemory::DeviceMemory(const ServedCamera& camera)
    : features_(MakeFeatures(camera)), registers_(reg::kMemoryEnd, 0) {
  const std::string xml = GenicamXml(features_);
  xml_.assign(xml.begin(), xml.end());
  xml_.resize((xml.size() + kPad - 1) / kPad * kPad, 0);
  const std::uint32_t address = ntohl(inet_addr(camera.address.c_str()));

  Set32(reg::kVersion, 0x00010002);
  Set32(reg::kDeviceMode, 0x80000001);  // Big endian, UTF-8.
  Set32(reg::kMacHigh, 0x0253);  // Locally administered; the rest is the address, hence unique.
  Set32(reg::kMacLow, address);
  Set32(reg::kIpCapabilities, 1);
  Set32(reg::kIpConfiguration, 1);
  Set32(reg::kCurrentIp, address);
  Set32(reg::kSubnetMask, 0xFF000000);
  SetText(reg::kVendorName, 32, "Sole");
  SetText(reg::kModelName, 32, "SimulatedCamera");
  SetText(reg::kDeviceVersion, 32, "1.0");
  SetText(reg::kManufacturerInfo, 48, "simulated GigE Vision camera");
  SetText(reg::kSerialNumber, 16, camera.serial);
  SetText(reg::kXmlUrl, 512,
          fmt::format("Local:sole_simulated_camera.xml;{:X};{:X}", reg::kXml, xml.size()));
  Set32(reg::kInterfaceCount, 1);
  Set32(reg::kStreamChannelCount, 1);
  Set32(reg::kCapabilities, kCapabilityBits);
  Set32(reg::kHeartbeatTimeout, 3000);
  Set64(reg::kTickFrequency, 1000000000);
  Set32(reg::kPacketSize, 1500);

  Set32(reg::kSensorWidth, static_cast<std::uint32_t>(camera.width));
  Set32(reg::kSensorHeight, static_cast<std::uint32_t>(camera.height));
  Set32(reg::kWidth, static_cast<std::uint32_t>(camera.width));
  Set32(reg::kHeight, static_cast<std::uint32_t>(camera.height));
  Set32(reg::kPixelFormat, kMono8);
  Set32(reg::kPayloadSize, static_cast<std::uint32_t>(camera.width * camera.height));
  Set32(reg::kFrameCount, 1);
  SetFloat(reg::kFrameRate, 10);
  SetFloat(reg::kExposureTime, camera.exposure_us);
  SetFloat(reg::kGain, camera.gain_db);
  Set32(reg::kTriggerSource, kSourceLine1);
  Set32(reg::kLineSelector, kLine1);
  Set32(reg::kActionSelector, 1);
  Set32(reg::kPtpStatus, kPtpDisabled);
}

GevStatus DeviceMemory::Read(std::uint32_t address, std::span<std::uint8_t> bytes) const {
  const auto copy = [&](const std::vector<std::uint8_t>& from, std::uint64_t at) {
    if (at + bytes.size() > from.size()) return GevStatus::kInvalidAddress;
    std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(at), bytes.size(), bytes.begin());
    return GevStatus::kSuccess;
  };
  return address >= reg::kXml ? copy(xml_, address - reg::kXml) : copy(registers_, address);
}

GevStatus DeviceMemory::CheckWrite(std::uint32_t address, std::span<const std::uint8_t> bytes,
                                   bool acquiring) const {
  if (address % 4 != 0 || bytes.size() % 4 != 0) return GevStatus::kBadAlignment;
  if (std::uint64_t{address} + bytes.size() > reg::kMemoryEnd) {
    return address >= reg::kXml ? GevStatus::kWriteProtect : GevStatus::kInvalidAddress;
  }
  const std::uint32_t end = address + static_cast<std::uint32_t>(bytes.size());
  for (std::uint32_t word = address; word < end; word += 4) {
    bool writable = false;
    for (const Feature& feature : features_) {
      if (word < feature.address || word >= feature.address + feature.length) continue;
      if (feature.access == FeatureAccess::kReadOnly) continue;
      writable = true;
      const GevStatus status = CheckFeature(feature, address, bytes, acquiring);
      if (status != GevStatus::kSuccess) return status;
    }
    if (!writable) return GevStatus::kWriteProtect;
  }
  return GevStatus::kSuccess;
}

GevStatus DeviceMemory::CheckFeature(const Feature& feature, std::uint32_t address,
                                     std::span<const std::uint8_t> bytes, bool acquiring) const {
  if (feature.kind == FeatureKind::kString) return GevStatus::kSuccess;
  if (feature.address < address || feature.address + feature.length > address + bytes.size()) {
    return GevStatus::kInvalidParameter;  // A number is written whole.
  }
  const std::size_t at = feature.address - address;
  if (feature.kind == FeatureKind::kFloat) {
    const double value = std::bit_cast<double>(Load64(bytes, at));
    const bool valid = std::isfinite(value) && value >= feature.min && value <= feature.max;
    return valid ? GevStatus::kSuccess : GevStatus::kInvalidParameter;
  }
  const auto bits = [&](std::uint32_t word) {
    return static_cast<std::uint32_t>((word >> feature.lsb) &
                                      ((std::uint64_t{1} << (feature.msb - feature.lsb + 1)) - 1));
  };
  const std::uint32_t value = bits(Load32(bytes, at));
  const bool changes = value != bits(Get32(feature.address));
  if (changes && acquiring && feature.locked_while_acquiring) return GevStatus::kWriteProtect;
  bool valid = true;
  if (feature.kind == FeatureKind::kInteger) {
    valid = value >= feature.min && value <= feature.max &&
            value % static_cast<std::uint32_t>(feature.increment) == 0;
  } else if (feature.kind == FeatureKind::kEnumeration) {
    valid = std::any_of(feature.entries.begin(), feature.entries.end(),
                        [&](const EnumEntry& entry) { return entry.value == value; });
  }
  return valid ? GevStatus::kSuccess : GevStatus::kInvalidParameter;
}

std::uint32_t DeviceMemory::Get32(std::uint32_t address) const {
  return Load32(registers_, address);
}
void DeviceMemory::Set32(std::uint32_t address, std::uint32_t value) {
  Store32(registers_, address, value);
}
std::uint64_t DeviceMemory::Get64(std::uint32_t address) const {
  return Load64(registers_, address);
}
void DeviceMemory::Set64(std::uint32_t address, std::uint64_t value) {
  Store64(registers_, address, value);
}
double DeviceMemory::GetFloat(std::uint32_t address) const {
  return std::bit_cast<double>(Get64(address));
}
void DeviceMemory::SetFloat(std::uint32_t address, double value) {
  Store64(registers_, address, std::bit_cast<std::uint64_t>(value));
}

void DeviceMemory::SetText(std::uint32_t address, std::uint32_t length, const std::string& text) {
  std::vector<std::uint8_t> bytes(length, 0);
  std::copy_n(text.begin(), std::min<std::size_t>(text.size(), length - 1), bytes.begin());
  SetBytes(address, bytes);
}

void DeviceMemory::SetBytes(std::uint32_t address, std::span<const std::uint8_t> bytes) {
  std::copy(bytes.begin(), bytes.end(), registers_.begin() + static_cast<std::ptrdiff_t>(address));
}

}  // namespace sole::sim
