#include "sim/gige/genicam_xml.h"

#include <algorithm>
#include <vector>

#include <fmt/format.h>

namespace sole::sim {
namespace {

std::string Tag(const std::string& name, const std::string& text) {
  return fmt::format("<{0}>{1}</{0}>", name, text);
}

std::string Open(const std::string& element, const std::string& name) {
  return fmt::format("<{} Name=\"{}\" NameSpace=\"Standard\">", element, name);
}

const char* AccessMode(const Feature& feature) {
  switch (feature.access) {
    case FeatureAccess::kReadOnly:
      return "RO";
    case FeatureAccess::kReadWrite:
      return "RW";
    case FeatureAccess::kWriteOnly:
      return "WO";
  }
  return "RO";
}

/// Address, length, access mode and port: the part all register nodes share.
std::string RegisterBody(const Feature& feature) {
  return Tag("Address", fmt::format("0x{:X}", feature.address)) +
         Tag("Length", fmt::format("{}", feature.length)) + Tag("AccessMode", AccessMode(feature)) +
         Tag("pPort", feature.chunk_id != 0 ? feature.name + "Port" : "Device") + Tag("Cachable", "NoCache");
}

/// The register node behind a numeric feature. GenICam counts the bits of big-endian registers from
/// the most significant.
std::string Register(const Feature& feature) {
  const std::string name = feature.name + "Reg";
  if (feature.kind == FeatureKind::kFloat) {
    return fmt::format("<FloatReg Name=\"{}\">{}<Endianess>BigEndian</Endianess></FloatReg>\n",
                       name, RegisterBody(feature));
  }
  const bool masked = feature.lsb != 0 || feature.msb != 31;
  const std::string element = masked ? "MaskedIntReg" : "IntReg";
  const std::string bits =
      masked ? fmt::format("<LSB>{}</LSB><MSB>{}</MSB>", 31 - feature.lsb, 31 - feature.msb) : "";
  return fmt::format(
      "<{0} Name=\"{1}\">{2}{3}<Sign>{4}</Sign><Endianess>BigEndian</Endianess></{0}>\n",
      element, name, RegisterBody(feature), bits, feature.is_signed ? "Signed" : "Unsigned");
}

std::string Limits(const Feature& feature) {
  if (feature.access == FeatureAccess::kReadOnly) return "";
  const bool integer = feature.kind == FeatureKind::kInteger;
  std::string limits = integer
                           ? fmt::format("<Min>{:.0f}</Min><Max>{:.0f}</Max><Inc>{:.0f}</Inc>",
                                         feature.min, feature.max, feature.increment)
                           : fmt::format("<Min>{}</Min><Max>{}</Max>", feature.min, feature.max);
  return limits;
}

std::string Node(const Feature& feature) {
  const std::string lock = feature.locked_while_acquiring ? Tag("pIsLocked", "TLParamsLocked") : "";
  const std::string value = Tag("pValue", feature.name + "Reg");
  const std::string unit = feature.unit.empty() ? "" : Tag("Unit", feature.unit);
  std::string selected;
  for (const std::string& name : feature.selects) selected += Tag("pSelected", name);
  switch (feature.kind) {
    case FeatureKind::kString:
      return Open("StringReg", feature.name) + RegisterBody(feature) + "</StringReg>\n";
    case FeatureKind::kInteger:
      return Open("Integer", feature.name) + lock + value + Limits(feature) + unit + selected +
             "</Integer>\n";
    case FeatureKind::kFloat:
      return Open("Float", feature.name) + lock + value + Limits(feature) + unit + "</Float>\n";
    case FeatureKind::kBoolean:
      return Open("Boolean", feature.name) + lock + value +
             "<OnValue>1</OnValue><OffValue>0</OffValue></Boolean>\n";
    case FeatureKind::kCommand:
      return Open("Command", feature.name) + lock + value +
             Tag("CommandValue", fmt::format("{}", feature.command)) + "</Command>\n";
    case FeatureKind::kEnumeration:
      break;
  }
  std::string entries;
  for (const EnumEntry& entry : feature.entries) {
    entries += Open("EnumEntry", entry.name) + Tag("Value", fmt::format("{}", entry.value)) +
               "</EnumEntry>";
  }
  return Open("Enumeration", feature.name) + lock + entries + value + selected + "</Enumeration>\n";
}

}  // namespace

std::string GenicamXml(std::span<const Feature> features) {
  std::vector<std::string> categories;
  for (const Feature& feature : features) {
    if (std::find(categories.begin(), categories.end(), feature.category) == categories.end()) {
      categories.push_back(feature.category);
    }
  }
  std::string xml =
      "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n"
      "<RegisterDescription ModelName=\"SimulatedCamera\" VendorName=\"Sole\" "
      "ToolTip=\"Simulated camera of the Sole foot scanner\" StandardNameSpace=\"GEV\" "
      "SchemaMajorVersion=\"1\" SchemaMinorVersion=\"1\" SchemaSubMinorVersion=\"0\" "
      "MajorVersion=\"1\" "
      "MinorVersion=\"0\" SubMinorVersion=\"0\" "
      "ProductGuid=\"5A1C0B52-63B6-4F0E-9B0A-2D5D0C4B7E01\" "
      "VersionGuid=\"B7E6B1C4-2F8B-4C55-8B3E-0D9A0C5F1A01\" "
      "xmlns=\"http://www.genicam.org/GenApi/Version_1_1\" "
      "xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
      "xsi:schemaLocation=\"http://www.genicam.org/GenApi/Version_1_1 "
      "GenApiSchema_Version_1_1.xsd\">\n";
  xml += Open("Category", "Root");
  for (const std::string& category : categories) xml += Tag("pFeature", category);
  xml += "</Category>\n";
  for (const std::string& category : categories) {
    xml += Open("Category", category);
    for (const Feature& feature : features) {
      if (feature.category == category) xml += Tag("pFeature", feature.name);
    }
    xml += "</Category>\n";
  }
  for (const Feature& feature : features) {
    xml += Node(feature);
    if (feature.kind != FeatureKind::kString) xml += Register(feature);
    if (feature.chunk_id != 0) {
      xml += fmt::format(
          "<Port Name=\"{}Port\" NameSpace=\"Standard\"><ChunkID>{:X}</ChunkID></Port>\n",
          feature.name, feature.chunk_id);
    }
  }
  xml +=
      "<Integer Name=\"TLParamsLocked\" "
      "NameSpace=\"Standard\"><Value>0</Value><Min>0</Min><Max>1</Max></Integer>\n";
  xml += "<Port Name=\"Device\" NameSpace=\"Standard\"/>\n</RegisterDescription>\n";
  return xml;
}

}  // namespace sole::sim
