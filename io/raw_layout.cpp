#include <sys/stat.h>

#include <cerrno>
#include <cstring>
#include <string_view>

#include "core/error.h"
#include "io/bytes_internal.h"
#include "io/raw_layout_internal.h"

namespace sole::io {
namespace {

constexpr std::uint32_t kVersion = 2;
constexpr std::string_view kFileMagic = "SOLERAW1";
constexpr std::string_view kRecordMagic = "SREC";
constexpr std::size_t kSerialOffset = 16, kHeaderCrcOffset = 60, kPayloadCrcOffset = 52,
                      kKindOffset = 56;

void Seal(RawHeaderBytes& bytes) {
  StoreLittle(bytes.data(), kHeaderCrcOffset, Crc32(bytes.data(), kHeaderCrcOffset));
}
bool SealHolds(const char* bytes) {
  return LoadLittle<std::uint32_t>(bytes, kHeaderCrcOffset) == Crc32(bytes, kHeaderCrcOffset);
}

}  // namespace

RawHeaderBytes EncodeRawFileHeader(const std::string& serial) {
  RawHeaderBytes bytes{};
  std::memcpy(bytes.data(), kFileMagic.data(), kFileMagic.size());
  StoreLittle(bytes.data(), 8, kVersion);
  StoreLittle(bytes.data(), 12, static_cast<std::uint32_t>(kRawBlock));
  std::memcpy(bytes.data() + kSerialOffset, serial.data(), serial.size());
  Seal(bytes);
  return bytes;
}

RawHeaderBytes EncodeRawRecord(const RawRecordHeader& header, std::uint32_t payload_crc) {
  RawHeaderBytes bytes{};
  std::memcpy(bytes.data(), kRecordMagic.data(), kRecordMagic.size());
  StoreLittle(bytes.data(), 4, header.status);
  StoreLittle(bytes.data(), 8, header.trigger);
  StoreLittle(bytes.data(), 16, header.frame_id);
  StoreLittle(bytes.data(), 24, header.device_time_ns);
  StoreLittle(bytes.data(), 32, header.host_time_ns);
  StoreLittle(bytes.data(), 40, header.width);
  StoreLittle(bytes.data(), 44, header.height);
  StoreLittle(bytes.data(), 48, header.width * header.height);
  StoreLittle(bytes.data(), kPayloadCrcOffset, payload_crc);
  const std::uint32_t kind = !header.kind ? 0 : *header.kind == ExposureKind::kSpeckle ? 1 : 2;
  StoreLittle(bytes.data(), kKindOffset, kind);
  Seal(bytes);
  return bytes;
}

bool DecodeRawRecord(const char* bytes, RawRecord& record) {
  if (std::memcmp(bytes, kRecordMagic.data(), kRecordMagic.size()) != 0 || !SealHolds(bytes))
    return false;
  RawRecordHeader& header = record.header;
  header.status = LoadLittle<std::uint32_t>(bytes, 4);
  header.trigger = LoadLittle<std::int64_t>(bytes, 8);
  header.frame_id = LoadLittle<std::uint64_t>(bytes, 16);
  header.device_time_ns = LoadLittle<std::uint64_t>(bytes, 24);
  header.host_time_ns = LoadLittle<std::int64_t>(bytes, 32);
  header.width = LoadLittle<std::uint32_t>(bytes, 40);
  header.height = LoadLittle<std::uint32_t>(bytes, 44);
  record.payload_crc = LoadLittle<std::uint32_t>(bytes, kPayloadCrcOffset);
  const auto kind = LoadLittle<std::uint32_t>(bytes, kKindOffset);
  header.kind.reset();
  if (kind == 1) header.kind = ExposureKind::kSpeckle;
  if (kind == 2) header.kind = ExposureKind::kTexture;
  return header.width > 0 && header.height > 0 && header.width < kRawMaxSide &&
         header.height < kRawMaxSide &&
         LoadLittle<std::uint32_t>(bytes, 48) == header.width * header.height;
}

FileDescriptor OpenForReading(const std::filesystem::path& path, std::uint64_t& size) {
  FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  Require(file.Valid() && ::fstat(file.Get(), &status) == 0,
          "cannot read " + path.string() + ": " + std::strerror(errno));
  Require(S_ISREG(status.st_mode), "cannot read " + path.string() + ": it is not a file");
  size = static_cast<std::uint64_t>(status.st_size);
  return file;
}

RawFileHead DecodeRawFileHead(const char* bytes, const std::filesystem::path& path) {
  Require(std::memcmp(bytes, kFileMagic.data(), kFileMagic.size()) == 0,
          path.string() + ": is not a recording of a camera: its first bytes are not SOLERAW1");
  const auto version = LoadLittle<std::uint32_t>(bytes, 8);
  const bool sealed = SealHolds(bytes);
  if (sealed && version != 1 && version != kVersion) {
    throw UnknownVersionError(path.string() + ": format version " + std::to_string(version) +
                              " is unknown: use the version of Sole that recorded it");
  }
  const std::size_t header_size = version == 1 ? kRawHeaderSize : kRawBlock;
  Require(sealed && LoadLittle<std::uint32_t>(bytes, 12) == header_size,
          path.string() + ": the file header is damaged");
  RawFileHead head;
  head.serial.assign(bytes + kSerialOffset, ::strnlen(bytes + kSerialOffset, kRawSerialSize));
  head.block = version == 1 ? 1 : kRawBlock;
  return head;
}

RawFileHead ReadRawFileHead(const FileDescriptor& file, std::uint64_t size,
                            const std::filesystem::path& path) {
  RawHeaderBytes bytes{};
  Require(size >= kRawHeaderSize && file.ReadAt(bytes.data(), kRawHeaderSize, 0),
          path.string() + ": is not a recording of a camera: it is shorter than a header");
  return DecodeRawFileHead(bytes.data(), path);
}

}  // namespace sole::io
