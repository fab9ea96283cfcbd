#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "sim/camera_server.h"

namespace sole::sim {

/// Registers of a simulated camera. Below 0x10000 the bootstrap registers of the GigE Vision
/// standard, above our own.
namespace reg {
inline constexpr std::uint32_t kVersion = 0x0000, kDeviceMode = 0x0004, kMacHigh = 0x0008,
                               kMacLow = 0x000C, kIpCapabilities = 0x0010,
                               kIpConfiguration = 0x0014, kCurrentIp = 0x0024, kSubnetMask = 0x0034,
                               kVendorName = 0x0048, kModelName = 0x0068, kDeviceVersion = 0x0088,
                               kManufacturerInfo = 0x00A8, kSerialNumber = 0x00D8,
                               kUserName = 0x00E8, kDiscoveryEnd = 0x00F8, kXmlUrl = 0x0200,
                               kInterfaceCount = 0x0600, kStreamChannelCount = 0x0904,
                               kActionKey = 0x090C, kCapabilities = 0x0934,
                               kHeartbeatTimeout = 0x0938, kTickFrequency = 0x093C,
                               kTimestampControl = 0x0944, kTimestampLatched = 0x0948,
                               kControl = 0x0A00, kStreamPort = 0x0D00, kPacketSize = 0x0D04,
                               kPacketDelay = 0x0D08, kStreamAddress = 0x0D18,
                               kStreamSourcePort = 0x0D1C, kActionGroupKey = 0x9800,
                               kActionGroupMask = 0x9804;
inline constexpr std::uint32_t kWidth = 0x10000, kHeight = 0x10004, kOffsetX = 0x10008,
                               kOffsetY = 0x1000C, kSensorWidth = 0x10010, kSensorHeight = 0x10014,
                               kPixelFormat = 0x10018, kPayloadSize = 0x1001C,
                               kAcquisitionMode = 0x10100, kAcquisitionStart = 0x10104,
                               kAcquisitionStop = 0x10108, kFrameCount = 0x1010C,
                               kFrameRate = 0x10110, kTriggerSelector = 0x10200,
                               kTriggerMode = 0x10204, kTriggerSource = 0x10208,
                               kTriggerActivation = 0x1020C, kTriggerSoftware = 0x10210,
                               kExposureMode = 0x10300, kExposureTime = 0x10308, kGain = 0x10310,
                               kLineSelector = 0x10400, kLineMode = 0x10404, kLineStatus = 0x10408,
                               kActionSelector = 0x10500, kPtpEnable = 0x10600,
                               kPtpStatus = 0x10604, kPtpLatch = 0x10608, kPtpOffset = 0x10610,
                               kChunkMode = 0x10700, kChunkSelector = 0x10704,
                               kChunkEnable = 0x10708;
inline constexpr std::uint32_t kMemoryEnd = 0x11000, kXml = 0x100000;
}  // namespace reg

inline constexpr std::uint32_t kMono8 = 0x01080001;
enum AcquisitionMode : std::uint32_t { kContinuous = 0, kSingleFrame = 1, kMultiFrame = 2 };
enum TriggerSource : std::uint32_t { kSourceSoftware = 0, kSourceLine1 = 1, kSourceAction1 = 2 };
enum Line : std::uint32_t { kLine1 = 1, kLine2 = 2 };

enum class FeatureKind { kInteger, kFloat, kEnumeration, kBoolean, kCommand, kString };
enum class FeatureAccess { kReadOnly, kReadWrite, kWriteOnly };

struct EnumEntry {
  std::string name{};
  std::uint32_t value = 0;
};

/// A GenICam feature and the register behind it: the one table from which the XML is written and
/// against which writes are checked. Integers, enumerations, booleans and commands take 4 bytes (8
/// for read-only 64-bit integers), floats 8.
struct Feature {
  std::string name{};
  std::string category{};
  FeatureKind kind = FeatureKind::kInteger;
  FeatureAccess access = FeatureAccess::kReadOnly;
  std::uint32_t address = 0;
  std::uint32_t length = 4;
  double min = 0;  ///< of integers and floats
  double max = 4294967295.0;
  double increment = 1;
  std::string unit{};
  std::vector<EnumEntry> entries{};
  std::vector<std::string> selects{};
  std::uint32_t command = 1;
  int lsb = 0;  ///< bits lsb to msb counted from the least significant one
  int msb = 31;
  bool locked_while_acquiring = false;
  bool is_signed = false;
  std::uint32_t chunk_id = 0;  ///< not in a register but in this chunk of a frame
};

/// Every feature of a camera.
std::vector<Feature> MakeFeatures(const ServedCamera& camera);

}  // namespace sole::sim
