#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "io/file_descriptor_internal.h"
#include "io/raw_file.h"

// The bytes of raw files, as docs/formats.md writes them down.
namespace sole::io {

constexpr std::size_t kRawHeaderSize = 64;  ///< of the file and of each record, without padding
constexpr std::uint32_t kRawMaxSide = 65536;
constexpr std::size_t kRawSerialSize = 44;

using RawHeaderBytes = std::array<char, kRawHeaderSize>;

/// `bytes` up to the next multiple of `block`.
constexpr std::uint64_t RoundUp(std::uint64_t bytes, std::uint64_t block) {
  return (bytes + block - 1) / block * block;
}

RawHeaderBytes EncodeRawFileHeader(const std::string& serial);
RawHeaderBytes EncodeRawRecord(const RawRecordHeader& header, std::uint32_t payload_crc);
/// False unless `bytes` hold an undamaged record header.
bool DecodeRawRecord(const char* bytes, RawRecord& record);

/// Opens an existing regular file; throws Error naming it.
FileDescriptor OpenForReading(const std::filesystem::path& path, std::uint64_t& size);

class UnknownVersionError : public Error {
 public:
  using Error::Error;
};

/// The file header.
struct RawFileHead {
  std::string serial;
  std::uint64_t block = 1;  ///< headers and payloads begin at multiples of this (1 in version 1)
};
/// Throws Error with the path unless these 64 bytes are an undamaged file header.
RawFileHead DecodeRawFileHead(const char* bytes, const std::filesystem::path& path);
/// The same for the beginning of a file.
RawFileHead ReadRawFileHead(const FileDescriptor& file, std::uint64_t size,
                            const std::filesystem::path& path);

/// Bytes of a record's header and its padding; of its payload and its padding.
inline std::uint64_t RawHeaderBlock(std::uint64_t block) { return RoundUp(kRawHeaderSize, block); }
inline std::uint64_t RawPayloadSize(const RawRecordHeader& header) {
  return std::uint64_t{header.width} * header.height;
}

/// Walks the records of an open raw file from its first block on.
RawIndex ScanRawRecords(const FileDescriptor& file, std::uint64_t size, std::uint64_t block);

/// Copies `size` bytes from one file to another's present place; false if either fails.
bool CopyBytes(const FileDescriptor& from, std::uint64_t offset, std::uint64_t size,
               const FileDescriptor& to);

}  // namespace sole::io
