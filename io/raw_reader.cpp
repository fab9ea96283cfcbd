#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>

#include "io/bytes_internal.h"
#include "io/raw_layout_internal.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

/// Offset of the next whole record header at or after `from`, at a multiple of `block`; `size` if
/// there is none.
std::uint64_t FindRecord(const FileDescriptor& file, std::uint64_t from, std::uint64_t size,
                         std::uint64_t block) {
  std::vector<char> chunk;
  constexpr std::uint64_t kChunk = 1 << 20;
  from = RoundUp(from, block);
  while (from < size && size - from >= kRawHeaderSize) {
    chunk.resize(static_cast<std::size_t>(std::min(kChunk + kRawHeaderSize, size - from)));
    if (!file.ReadAt(chunk.data(), chunk.size(), from)) return size;
    RawRecord ignored;
    std::uint64_t at = 0;
    for (; at + kRawHeaderSize <= chunk.size(); at += block) {
      if (chunk[at] == 'S' && DecodeRawRecord(chunk.data() + at, ignored)) return from + at;
    }
    from += at;
  }
  return size;
}

std::string Where(const fs::path& path, const RawRecord& record) {
  return path.string() + ": record of trigger " + std::to_string(record.header.trigger) + " ";
}

/// The record's pixels, checked against the header in the file but not against their checksum.
ImageU8 ReadPixels(const fs::path& path, const RawRecord& record) {
  std::uint64_t size = 0;
  const FileDescriptor file = OpenForReading(path, size);
  const std::uint64_t payload = RawPayloadSize(record.header);
  RawHeaderBytes bytes{};
  RawRecord found;
  Require(
      record.header_offset < size && record.payload_offset <= size &&
          size - record.payload_offset >= payload &&
          file.ReadAt(bytes.data(), kRawHeaderSize, record.header_offset) &&
          DecodeRawRecord(bytes.data(), found) && found.header.trigger == record.header.trigger &&
          found.payload_crc == record.payload_crc && found.header.width == record.header.width &&
          found.header.height == record.header.height,
      Where(path, record) + "is not where the index says: read the index again");
  ImageU8 image(static_cast<int>(found.header.width), static_cast<int>(found.header.height));
  if (!file.ReadAt(image.pixels.data(), image.pixels.size(), record.payload_offset))
    throw DamagedRecordError(Where(path, record) + "cannot be read: " + std::strerror(errno));
  return image;
}

}  // namespace

RawIndex ScanRawRecords(const FileDescriptor& file, std::uint64_t size, std::uint64_t block) {
  RawIndex index;
  const std::uint64_t header_block = RawHeaderBlock(block);
  RawHeaderBytes bytes{};
  std::uint64_t at = header_block;
  index.end = at;
  while (at < size) {
    RawRecord record;
    if (size - at < kRawHeaderSize || !file.ReadAt(bytes.data(), kRawHeaderSize, at)) {
      index.truncated = true;
      break;
    }
    if (!DecodeRawRecord(bytes.data(), record)) {
      const std::uint64_t next = FindRecord(file, at + 1, size, block);
      index.truncated = next == size;
      index.skipped_bytes += next - at;
      at = next;
      continue;
    }
    record.header_offset = at;
    record.payload_offset = at + header_block;
    const std::uint64_t payload = RawPayloadSize(record.header);
    if (record.payload_offset > size || size - record.payload_offset < payload) {
      index.truncated = true;
      break;
    }
    index.records.push_back(record);
    at = RoundUp(record.payload_offset + payload, block);
    index.end = at;
  }
  return index;
}

RawIndex ReadRawIndex(const fs::path& path) {
  std::uint64_t size = 0;
  const FileDescriptor file = OpenForReading(path, size);
  const RawFileHead head = ReadRawFileHead(file, size, path);
  RawIndex index = ScanRawRecords(file, size, head.block);
  index.serial = head.serial;
  return index;
}

bool CopyBytes(const FileDescriptor& from, std::uint64_t offset, std::uint64_t size,
               const FileDescriptor& to) {
  std::vector<char> chunk(static_cast<std::size_t>(std::min<std::uint64_t>(size, 1 << 20)));
  while (size > 0) {
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(size, chunk.size()));
    if (!from.ReadAt(chunk.data(), count, offset) || !to.Write(chunk.data(), count)) return false;
    offset += count;
    size -= count;
  }
  return true;
}

bool CheckRawRecord(const fs::path& path, const RawRecord& record) {
  try {
    const ImageU8 image = ReadPixels(path, record);
    return Crc32(image.pixels.data(), image.pixels.size()) == record.payload_crc;
  } catch (const DamagedRecordError&) {
    return false;
  }
}

ImageU8 ReadRawImage(const fs::path& path, const RawRecord& record) {
  ImageU8 image = ReadPixels(path, record);
  if (Crc32(image.pixels.data(), image.pixels.size()) != record.payload_crc) {
    throw DamagedRecordError(Where(path, record) +
                             "fails its checksum: the recording is damaged there");
  }
  return image;
}

}  // namespace sole::io
