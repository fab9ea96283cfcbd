#include "sim/gige/feature_table.h"

#include <utility>

#include "sim/gige/chunk_data.h"
#include "sim/gige/device_clock.h"

namespace sole::sim {
namespace {

using enum FeatureKind;
using enum FeatureAccess;

Feature Text(std::string name, std::uint32_t address, std::uint32_t length, FeatureAccess access) {
  return {.name = std::move(name),
          .category = "DeviceControl",
          .kind = kString,
          .access = access,
          .address = address,
          .length = length};
}

Feature Fixed(std::string name, std::string category, std::uint32_t address,
              std::uint32_t length = 4) {
  return {.name = std::move(name),
          .category = std::move(category),
          .address = address,
          .length = length};
}

Feature Number(std::string name, std::string category, std::uint32_t address, double min,
               double max, bool locked = false) {
  return {.name = std::move(name),
          .category = std::move(category),
          .access = kReadWrite,
          .address = address,
          .min = min,
          .max = max,
          .locked_while_acquiring = locked};
}

Feature Real(std::string name, std::string category, std::uint32_t address, double min, double max,
             std::string unit) {
  return {.name = std::move(name),
          .category = std::move(category),
          .kind = kFloat,
          .access = kReadWrite,
          .address = address,
          .length = 8,
          .min = min,
          .max = max,
          .unit = std::move(unit)};
}

Feature Choice(std::string name, std::string category, std::uint32_t address,
               std::vector<EnumEntry> entries, FeatureAccess access = kReadWrite,
               std::vector<std::string> selects = {}) {
  return {.name = std::move(name),
          .category = std::move(category),
          .kind = kEnumeration,
          .access = access,
          .address = address,
          .entries = std::move(entries),
          .selects = std::move(selects)};
}

Feature Command(std::string name, std::string category, std::uint32_t address,
                std::uint32_t value = 1) {
  return {.name = std::move(name),
          .category = std::move(category),
          .kind = kCommand,
          .access = kWriteOnly,
          .address = address,
          .command = value};
}

Feature Bits(Feature feature, int lsb, int msb) {
  feature.lsb = lsb;
  feature.msb = msb;
  return feature;
}

void AddImageFormat(const ServedCamera& camera, std::vector<Feature>* all) {
  const std::string category = "ImageFormatControl";
  all->push_back(Fixed("SensorWidth", category, reg::kSensorWidth));
  all->push_back(Fixed("SensorHeight", category, reg::kSensorHeight));
  all->push_back(Number("Width", category, reg::kWidth, 4, camera.width, true));
  all->push_back(Number("Height", category, reg::kHeight, 4, camera.height, true));
  all->push_back(Number("OffsetX", category, reg::kOffsetX, 0, camera.width - 4, true));
  all->push_back(Number("OffsetY", category, reg::kOffsetY, 0, camera.height - 4, true));
  all->push_back(Choice("PixelFormat", category, reg::kPixelFormat, {{"Mono8", kMono8}}));
  all->back().locked_while_acquiring = true;
  all->push_back(Fixed("PayloadSize", category, reg::kPayloadSize));
}

void AddAcquisition(std::vector<Feature>* all) {
  const std::string category = "AcquisitionControl";
  all->push_back(Choice(
      "AcquisitionMode", category, reg::kAcquisitionMode,
      {{"Continuous", kContinuous}, {"SingleFrame", kSingleFrame}, {"MultiFrame", kMultiFrame}}));
  all->push_back(Command("AcquisitionStart", category, reg::kAcquisitionStart));
  all->push_back(Command("AcquisitionStop", category, reg::kAcquisitionStop));
  all->push_back(Number("AcquisitionFrameCount", category, reg::kFrameCount, 1, 65535));
  all->push_back(Real("AcquisitionFrameRate", category, reg::kFrameRate, 0.1, 1000, "Hz"));
  all->push_back(Choice("TriggerSelector", category, reg::kTriggerSelector, {{"FrameStart", 0}},
                        kReadWrite,
                        {"TriggerMode", "TriggerSource", "TriggerActivation", "TriggerSoftware"}));
  all->push_back(Choice("TriggerMode", category, reg::kTriggerMode, {{"Off", 0}, {"On", 1}}));
  all->push_back(Choice(
      "TriggerSource", category, reg::kTriggerSource,
      {{"Software", kSourceSoftware}, {"Line1", kSourceLine1}, {"Action1", kSourceAction1}}));
  all->push_back(Choice("TriggerActivation", category, reg::kTriggerActivation,
                        {{"RisingEdge", 0}, {"FallingEdge", 1}}));
  all->push_back(Command("TriggerSoftware", category, reg::kTriggerSoftware));
  all->push_back(Choice("ExposureMode", category, reg::kExposureMode, {{"Timed", 0}}));
  all->push_back(Real("ExposureTime", category, reg::kExposureTime, 10, 1e6, "us"));
  all->push_back(Real("Gain", "AnalogControl", reg::kGain, 0, 48, "dB"));
  all->push_back(Choice("LineSelector", "DigitalIOControl", reg::kLineSelector,
                        {{"Line1", kLine1}, {"Line2", kLine2}}, kReadWrite,
                        {"LineMode", "LineStatus"}));
  all->push_back(Choice("LineMode", "DigitalIOControl", reg::kLineMode,
                        {{"Input", 0}, {"Output", 1}}, kReadOnly));
  all->push_back(Fixed("LineStatus", "DigitalIOControl", reg::kLineStatus));
  all->back().kind = kBoolean;
  all->push_back(Number("ActionDeviceKey", "ActionControl", reg::kActionKey, 0, 4294967295.0));
  all->push_back(Number("ActionSelector", "ActionControl", reg::kActionSelector, 1, 1));
  all->back().selects = {"ActionGroupKey", "ActionGroupMask"};
  all->push_back(Number("ActionGroupKey", "ActionControl", reg::kActionGroupKey, 0, 4294967295.0));
  all->push_back(
      Number("ActionGroupMask", "ActionControl", reg::kActionGroupMask, 0, 4294967295.0));
}

void AddTransport(std::vector<Feature>* all) {
  const std::string category = "TransportLayerControl";
  all->push_back(Choice("GevCCP", category, reg::kControl,
                        {{"OpenAccess", 0},
                         {"ExclusiveAccess", 1},
                         {"ControlAccess", 2},
                         {"ControlExclusiveAccess", 3}}));
  all->push_back(Number("GevHeartbeatTimeout", category, reg::kHeartbeatTimeout, 100, 60000));
  all->back().unit = "ms";
  all->push_back(Fixed("GevTimestampTickFrequency", category, reg::kTickFrequency, 8));
  all->push_back(Command("GevTimestampControlLatch", category, reg::kTimestampControl, 2));
  all->push_back(Fixed("GevTimestampValue", category, reg::kTimestampLatched, 8));
  all->push_back(Fixed("GevStreamChannelCount", category, reg::kStreamChannelCount));
  all->push_back(Number("GevStreamChannelSelector", category, reg::kActionSelector + 4, 0, 0));
  all->push_back(Bits(Number("GevSCPHostPort", category, reg::kStreamPort, 0, 65535, true), 0, 15));
  all->push_back(Bits(Command("GevSCPSFireTestPacket", category, reg::kPacketSize), 31, 31));
  all->back().access = kReadWrite;
  all->push_back(Bits(Number("GevSCPSDoNotFragment", category, reg::kPacketSize, 0, 1), 30, 30));
  all->back().kind = kBoolean;
  all->push_back(
      Bits(Number("GevSCPSPacketSize", category, reg::kPacketSize, 576, 65500, true), 0, 15));
  all->back().increment = 4;
  all->push_back(Number("GevSCPD", category, reg::kPacketDelay, 0, 10000000));
  all->back().unit = "ns";
  all->push_back(Number("GevSCDA", category, reg::kStreamAddress, 0, 4294967295.0, true));
  all->push_back(Bits(Fixed("GevSCSP", category, reg::kStreamSourcePort), 0, 15));
  all->push_back(Fixed("GevCurrentIPAddress", category, reg::kCurrentIp));
}

void AddClock(std::vector<Feature>* all) {
  const std::string category = "TransportLayerControl";
  all->push_back(Number("GevIEEE1588", category, reg::kPtpEnable, 0, 1));
  all->back().kind = kBoolean;
  all->push_back(Choice("GevIEEE1588Status", category, reg::kPtpStatus,
                        {{"Disabled", kPtpDisabled},
                         {"Uncalibrated", kPtpUncalibrated},
                         {"Slave", kPtpSlave}},
                        kReadOnly));
  all->push_back(Command("GevIEEE1588DataSetLatch", category, reg::kPtpLatch));
  all->push_back(Fixed("GevIEEE1588OffsetFromMaster", category, reg::kPtpOffset, 8));
  all->back().is_signed = true;
  all->back().unit = "ns";
}

void AddChunks(std::vector<Feature>* all) {
  const std::string category = "ChunkDataControl";
  all->push_back(Number("ChunkModeActive", category, reg::kChunkMode, 0, 1, true));
  all->back().kind = kBoolean;
  std::vector<EnumEntry> entries;
  for (std::uint32_t kind = 0; kind < kChunks.size(); ++kind)
    entries.push_back({kChunks[kind].name, kind});
  all->push_back(Choice("ChunkSelector", category, reg::kChunkSelector, std::move(entries),
                        kReadWrite, {"ChunkEnable"}));
  all->push_back(Number("ChunkEnable", category, reg::kChunkEnable, 0, 1, true));
  all->back().kind = kBoolean;
  for (std::uint32_t kind = 0; kind < kChunks.size(); ++kind) {
    const ChunkInfo& chunk = kChunks[kind];
    all->push_back(Fixed(std::string("Chunk") + chunk.name, category, 0, chunk.length));
    all->back().chunk_id = chunk.id;
    if (kind == kChunkExposureTime) all->back().kind = kFloat;
    all->back().is_signed = kind == kChunkTriggerSequence;
  }
}

}  // namespace

std::vector<Feature> MakeFeatures(const ServedCamera& camera) {
  std::vector<Feature> all = {Text("DeviceVendorName", reg::kVendorName, 32, kReadOnly),
                              Text("DeviceModelName", reg::kModelName, 32, kReadOnly),
                              Text("DeviceVersion", reg::kDeviceVersion, 32, kReadOnly),
                              Text("DeviceManufacturerInfo", reg::kManufacturerInfo, 48, kReadOnly),
                              Text("DeviceSerialNumber", reg::kSerialNumber, 16, kReadOnly),
                              Text("DeviceID", reg::kSerialNumber, 16, kReadOnly),
                              Text("DeviceUserID", reg::kUserName, 16, kReadWrite)};
  AddImageFormat(camera, &all);
  AddAcquisition(&all);
  AddTransport(&all);
  AddClock(&all);
  AddChunks(&all);
  return all;
}

}  // namespace sole::sim
