#include "io/raw_file.h"

#include <sys/stat.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <string_view>

#include "core/error.h"
#include "io/bytes_internal.h"
#include "io/file_descriptor_internal.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

// The layout is written down byte by byte in docs/formats.md.
constexpr std::size_t kHeaderSize = 64;  ///< of the file and of each record
constexpr std::uint32_t kVersion = 1;
constexpr std::string_view kFileMagic = "SOLERAW1";
constexpr std::string_view kRecordMagic = "SREC";
constexpr std::size_t kSerialOffset = 16, kSerialSize = 44, kHeaderCrcOffset = 60,
                      kPayloadCrcOffset = 52;
constexpr std::uint32_t kMaxSide = 65536;

using HeaderBytes = std::array<char, kHeaderSize>;

void Seal(HeaderBytes& bytes) {
  StoreLittle(bytes.data(), kHeaderCrcOffset, Crc32(bytes.data(), kHeaderCrcOffset));
}
bool SealHolds(const char* bytes) {
  return LoadLittle<std::uint32_t>(bytes, kHeaderCrcOffset) == Crc32(bytes, kHeaderCrcOffset);
}

HeaderBytes EncodeRecord(const RawRecordHeader& header, std::uint32_t payload_crc) {
  HeaderBytes bytes{};
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
  Seal(bytes);
  return bytes;
}

/// True if `bytes` hold an undamaged record header.
bool DecodeRecord(const char* bytes, RawRecordHeader& header) {
  if (std::memcmp(bytes, kRecordMagic.data(), kRecordMagic.size()) != 0 || !SealHolds(bytes))
    return false;
  header.status = LoadLittle<std::uint32_t>(bytes, 4);
  header.trigger = LoadLittle<std::int64_t>(bytes, 8);
  header.frame_id = LoadLittle<std::uint64_t>(bytes, 16);
  header.device_time_ns = LoadLittle<std::uint64_t>(bytes, 24);
  header.host_time_ns = LoadLittle<std::int64_t>(bytes, 32);
  header.width = LoadLittle<std::uint32_t>(bytes, 40);
  header.height = LoadLittle<std::uint32_t>(bytes, 44);
  return header.width > 0 && header.height > 0 && header.width < kMaxSide &&
         header.height < kMaxSide &&
         LoadLittle<std::uint32_t>(bytes, 48) == header.width * header.height;
}

FileDescriptor OpenForReading(const fs::path& path, std::uint64_t& size) {
  FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  Require(file.Valid() && ::fstat(file.Get(), &status) == 0,
          "cannot read " + path.string() + ": " + std::strerror(errno));
  Require(S_ISREG(status.st_mode), "cannot read " + path.string() + ": it is not a file");
  size = static_cast<std::uint64_t>(status.st_size);
  return file;
}

/// Offset of the next whole record header at or after `from`; `size` if there is none.
std::uint64_t FindRecord(const FileDescriptor& file, std::uint64_t from, std::uint64_t size) {
  std::vector<char> chunk;
  constexpr std::uint64_t kChunk = 1 << 20;
  while (size - from >= kHeaderSize) {
    chunk.resize(static_cast<std::size_t>(std::min(kChunk + kHeaderSize, size - from)));
    if (!file.ReadAt(chunk.data(), chunk.size(), from)) return size;
    const std::string_view view(chunk.data(), chunk.size());
    RawRecordHeader ignored;
    for (std::size_t at = view.find(kRecordMagic);
         at != std::string_view::npos && at + kHeaderSize <= view.size();
         at = view.find(kRecordMagic, at + 1)) {
      if (DecodeRecord(chunk.data() + at, ignored)) return from + at;
    }
    from += chunk.size() - kHeaderSize + 1;
  }
  return size;
}

}  // namespace

struct RawFileWriter::State {
  fs::path path;
  fs::path partial;
  FileDescriptor file;
  std::uint64_t end = 0;  ///< of the last whole record

  [[noreturn]] void Fail(const char* action) const {
    throw Error(std::string("cannot ") + action + " " + partial.string() + ": " +
                std::strerror(errno) + ": check that the folder exists, is writable and has room");
  }
};

RawFileWriter::RawFileWriter(const fs::path& path, const std::string& serial)
    : state_(std::make_unique<State>()) {
  Require(serial.size() < kSerialSize,
          path.string() + ": serial '" + serial + "' is longer than 43 bytes");
  state_->path = path;
  state_->partial = path.string() + ".partial";
  Require(!fs::exists(path),
          "cannot write " + path.string() + ": it exists already: record under another name");
  state_->file = FileDescriptor(
      ::open(state_->partial.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644));
  if (!state_->file.Valid()) state_->Fail("create");
  HeaderBytes bytes{};
  std::memcpy(bytes.data(), kFileMagic.data(), kFileMagic.size());
  StoreLittle(bytes.data(), 8, kVersion);
  StoreLittle(bytes.data(), 12, static_cast<std::uint32_t>(kHeaderSize));
  std::memcpy(bytes.data() + kSerialOffset, serial.data(), serial.size());
  Seal(bytes);
  if (!state_->file.Write(bytes.data(), bytes.size())) state_->Fail("write");
  state_->end = kHeaderSize;
}

RawFileWriter::~RawFileWriter() = default;

void RawFileWriter::Append(const RawRecordHeader& header, const std::uint8_t* pixels) {
  State& state = *state_;
  Require(state.file.Valid(),
          state.path.string() + " is closed: nothing more can be recorded into it");
  Require(
      header.width > 0 && header.height > 0 && header.width < kMaxSide && header.height < kMaxSide,
      state.path.string() + ": an image of " + std::to_string(header.width) + " x " +
          std::to_string(header.height) + " pixels cannot be recorded");
  const std::size_t size = std::size_t{header.width} * header.height;
  const HeaderBytes bytes = EncodeRecord(header, Crc32(pixels, size));
  if (!state.file.Write(bytes.data(), bytes.size()) || !state.file.Write(pixels, size)) {
    const int reason = errno;
    // Take the torn record away, so that a later one follows the last whole one.
    const bool rewound = ::ftruncate(state.file.Get(), static_cast<off_t>(state.end)) == 0 &&
                         ::lseek(state.file.Get(), static_cast<off_t>(state.end), SEEK_SET) >= 0;
    if (!rewound) state.file.Close();
    errno = reason;
    state.Fail("write");
  }
  state.end += kHeaderSize + size;
}

void RawFileWriter::Close() {
  State& state = *state_;
  if (!state.file.Valid()) return;
  if (::fsync(state.file.Get()) != 0 || !state.file.Close()) state.Fail("finish");
  if (::rename(state.partial.c_str(), state.path.c_str()) != 0) state.Fail("rename");
  const fs::path folder = state.path.has_parent_path() ? state.path.parent_path() : fs::path(".");
  const FileDescriptor directory(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (directory.Valid()) ::fsync(directory.Get());
}

RawIndex ReadRawIndex(const fs::path& path) {
  std::uint64_t size = 0;
  const FileDescriptor file = OpenForReading(path, size);
  HeaderBytes bytes{};
  Require(size >= kHeaderSize && file.ReadAt(bytes.data(), kHeaderSize, 0) &&
              std::memcmp(bytes.data(), kFileMagic.data(), kFileMagic.size()) == 0,
          path.string() + ": is not a recording of a camera: its first bytes are not SOLERAW1");
  const auto version = LoadLittle<std::uint32_t>(bytes.data(), 8);
  Require(version == kVersion, path.string() + ": format version " + std::to_string(version) +
                                   " is unknown: use the version of Sole that recorded it");
  Require(SealHolds(bytes.data()) && LoadLittle<std::uint32_t>(bytes.data(), 12) == kHeaderSize,
          path.string() + ": the file header is damaged");
  RawIndex index;
  index.serial.assign(bytes.data() + kSerialOffset,
                      ::strnlen(bytes.data() + kSerialOffset, kSerialSize));
  std::uint64_t at = kHeaderSize;
  while (at < size) {
    RawRecord record;
    if (size - at < kHeaderSize || !file.ReadAt(bytes.data(), kHeaderSize, at)) {
      index.truncated = true;
      break;
    }
    if (!DecodeRecord(bytes.data(), record.header)) {
      const std::uint64_t next = FindRecord(file, at + 1, size);
      index.truncated = next == size;
      index.skipped_bytes += next - at;
      at = next;
      continue;
    }
    record.payload_offset = at + kHeaderSize;
    const std::uint64_t payload = std::uint64_t{record.header.width} * record.header.height;
    if (size - record.payload_offset < payload) {
      index.truncated = true;
      break;
    }
    index.records.push_back(record);
    at = record.payload_offset + payload;
  }
  return index;
}

ImageU8 ReadRawImage(const fs::path& path, const RawRecord& record) {
  std::uint64_t size = 0;
  const FileDescriptor file = OpenForReading(path, size);
  const std::string where =
      path.string() + ": record of trigger " + std::to_string(record.header.trigger) + " ";
  const std::uint64_t payload = std::uint64_t{record.header.width} * record.header.height;
  HeaderBytes bytes{};
  RawRecordHeader header;
  Require(record.payload_offset >= kHeaderSize && record.payload_offset <= size &&
              size - record.payload_offset >= payload &&
              file.ReadAt(bytes.data(), kHeaderSize, record.payload_offset - kHeaderSize) &&
              DecodeRecord(bytes.data(), header) && header.trigger == record.header.trigger &&
              header.width == record.header.width && header.height == record.header.height,
          where + "is not where the index says: read the index again");
  ImageU8 image(static_cast<int>(header.width), static_cast<int>(header.height));
  Require(file.ReadAt(image.pixels.data(), image.pixels.size(), record.payload_offset),
          where + "cannot be read: " + std::strerror(errno));
  Require(Crc32(image.pixels.data(), image.pixels.size()) ==
              LoadLittle<std::uint32_t>(bytes.data(), kPayloadCrcOffset),
          where + "fails its checksum: the recording is damaged there");
  return image;
}

}  // namespace sole::io
