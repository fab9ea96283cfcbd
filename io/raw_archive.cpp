#include "io/raw_archive.h"

#include <cstring>
#include <utility>
#include <vector>

#include "io/archive_video_internal.h"
#include "io/atomic_file.h"
#include "io/bytes_internal.h"
#include "io/raw_layout_internal.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMaxAttachment = 128 << 20;  // of Matroska elements that libavformat reads

/// The file header and every record header, 64 bytes each: everything of a raw file but pixels and
/// padding.
struct Headers {
  std::string bytes;
  RawIndex index;
  RawFileHead head;

  std::string_view At(std::size_t record) const {
    return std::string_view(bytes).substr((record + 1) * kRawHeaderSize, kRawHeaderSize);
  }
  std::string_view File() const { return std::string_view(bytes).substr(0, kRawHeaderSize); }
};

void Step(const ArchiveOptions& options, const fs::path& path) {
  Require(options.stop == nullptr || !options.stop->load(),
          "stopped: " + path.string() + " was left as it was");
  if (options.progress) options.progress();
}

Headers HeadersOfRaw(const fs::path& raw) {
  std::uint64_t size = 0;
  const FileDescriptor file = OpenForReading(raw, size);
  Headers headers;
  headers.head = ReadRawFileHead(file, size, raw);
  headers.index = ReadRawIndex(raw);
  // Only what RestoreRawFile would write again may be compressed.
  const RawIndex& index = headers.index;
  std::uint64_t at = RawHeaderBlock(headers.head.block);
  for (const RawRecord& record : index.records) {
    Require(record.header_offset == at && record.header.width == index.records[0].header.width &&
                record.header.height == index.records[0].header.height,
            raw.string() + ": record of trigger " + std::to_string(record.header.trigger) +
                " is damaged or of another size: recover the take first");
    at = RoundUp(record.payload_offset + RawPayloadSize(record.header), headers.head.block);
  }
  Require(!index.truncated && index.skipped_bytes == 0 && size == at,
          raw.string() + ": is damaged at its end: recover the take first");
  headers.bytes.resize((index.records.size() + 1) * kRawHeaderSize);
  Require(headers.bytes.size() <= kMaxAttachment,
          raw.string() + ": has too many records for one archive");
  bool read = file.ReadAt(headers.bytes.data(), kRawHeaderSize, 0);
  for (std::size_t i = 0; i < index.records.size(); ++i) {
    read = read && file.ReadAt(&headers.bytes[(i + 1) * kRawHeaderSize], kRawHeaderSize,
                               index.records[i].header_offset);
  }
  Require(read, raw.string() + ": cannot be read");
  return headers;
}

Headers HeadersOfArchive(const fs::path& archive, const VideoFormat& format) {
  Headers headers;
  headers.bytes = format.attachment;
  const std::string damaged = archive.string() + ": its list of records is damaged";
  Require(headers.bytes.size() % kRawHeaderSize == 0, damaged);
  headers.head = DecodeRawFileHead(headers.bytes.data(), archive);
  headers.index.serial = headers.head.serial;
  const std::size_t count = headers.bytes.size() / kRawHeaderSize - 1;
  for (std::size_t i = 0; i < count; ++i) {
    RawRecord record;
    Require(DecodeRawRecord(headers.At(i).data(), record) &&
                record.header.width == static_cast<std::uint32_t>(format.width) &&
                record.header.height == static_cast<std::uint32_t>(format.height),
            damaged);
    headers.index.records.push_back(record);
  }
  return headers;
}

bool Holds(const ImageU8& image, const RawRecord& record) {
  return Crc32(image.pixels.data(), image.pixels.size()) == record.payload_crc;
}

ImageU8 NextFrame(VideoReader& video, const fs::path& archive) {
  std::optional<ImageU8> image = video.Next();
  Require(image.has_value(), archive.string() + ": holds fewer frames than records: it is cut");
  return *std::move(image);
}

void RequireEnd(VideoReader& video, const Headers& headers, const fs::path& archive) {
  if (headers.index.records.empty()) NextFrame(video, archive);  // the black one
  Require(!video.Next(), archive.string() + ": holds more frames than records");
}

/// Throws Error unless the archive gives these headers and pixels that match their CRCs back.
void Compare(const fs::path& archive, const Headers& headers, const ArchiveOptions& options) {
  VideoReader video(archive);
  Require(video.Format().attachment == headers.bytes,
          archive.string() + ": gives other headers back than it was made from");
  for (const RawRecord& record : headers.index.records) {
    Step(options, archive);
    Require(Holds(NextFrame(video, archive), record),
            archive.string() + ": gives other pixels back than it was made from");
  }
  RequireEnd(video, headers, archive);
}

}  // namespace

void ArchiveRawFile(const fs::path& raw, const fs::path& archive, const ArchiveOptions& options) {
  const Headers headers = HeadersOfRaw(raw);
  const std::vector<RawRecord>& records = headers.index.records;
  if (fs::exists(archive)) return Compare(archive, headers, options);
  VideoFormat format{.rate_hz = options.rate_hz,
                     .attachment = headers.bytes,
                     .attachment_name = headers.index.serial + ".records"};
  // A recording without records still has headers to keep; a video needs a frame: a black one.
  const ImageU8 black(64, 64);
  format.width = records.empty() ? black.width : static_cast<int>(records[0].header.width);
  format.height = records.empty() ? black.height : static_cast<int>(records[0].header.height);
  WriteAtomically(archive, [&](const fs::path& temporary) {
    VideoWriter video(temporary, format);
    if (records.empty()) video.Append(black.pixels.data());
    for (const RawRecord& record : records) {
      Step(options, raw);
      video.Append(ReadRawImage(raw, record).pixels.data());
    }
    video.Close();
    Compare(temporary, headers, options);
  });
  SyncDirectory(archive);
}

void RestoreRawFile(const fs::path& archive, const fs::path& raw, const ArchiveOptions& options) {
  VideoReader video(archive);
  const Headers headers = HeadersOfArchive(archive, video.Format());
  Require(!fs::exists(raw) && !fs::exists(raw.string() + ".partial"),
          "cannot write " + raw.string() + ": it exists already: move it away first");
  WriteAtomically(raw, [&](const fs::path& temporary) {
    const FileDescriptor file(
        ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
    const auto write = [&](const void* bytes, std::size_t size) {
      const std::vector<char> padding(RoundUp(size, headers.head.block) - size);
      Require(file.Valid() && file.Write(bytes, size) && file.Write(padding.data(), padding.size()),
              "cannot write " + raw.string() + ": " + std::strerror(errno) +
                  ": check that the folder is writable and has room");
    };
    write(headers.File().data(), kRawHeaderSize);
    for (std::size_t i = 0; i < headers.index.records.size(); ++i) {
      Step(options, archive);
      const RawRecord& record = headers.index.records[i];
      const ImageU8 image = NextFrame(video, archive);
      Require(Holds(image, record), archive.string() + ": record of trigger " +
                                        std::to_string(record.header.trigger) +
                                        " does not match its checksum: the archive is damaged");
      write(headers.At(i).data(), kRawHeaderSize);
      write(image.pixels.data(), image.pixels.size());
    }
    RequireEnd(video, headers, archive);
    Require(::fsync(file.Get()) == 0, "cannot write " + raw.string() + ": " + std::strerror(errno));
  });
  SyncDirectory(raw);
}

RawIndex ReadArchiveIndex(const fs::path& archive) {
  return HeadersOfArchive(archive, VideoReader(archive).Format()).index;
}

void CheckArchive(const fs::path& archive,
                  const std::function<void(std::size_t record, bool holds)>& visit) {
  VideoReader video(archive);
  const Headers headers = HeadersOfArchive(archive, video.Format());
  for (std::size_t i = 0; i < headers.index.records.size(); ++i)
    visit(i, Holds(NextFrame(video, archive), headers.index.records[i]));
  RequireEnd(video, headers, archive);
}

}  // namespace sole::io
