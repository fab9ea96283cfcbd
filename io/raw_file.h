#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/frame_set.h"
#include "core/image.h"

namespace sole::io {

/// What is known about one recorded frame. Stored in front of its pixels.
struct RawRecordHeader {
  std::int64_t trigger = 0;          ///< counts from 1; 0 = none
  std::uint64_t frame_id = 0;        ///< unwrapped device frame id
  std::uint64_t device_time_ns = 0;  ///< camera clock
  std::int64_t host_time_ns = 0;     ///< CLOCK_REALTIME at arrival
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint32_t status = 0;            ///< 0 good; bit 0 incomplete
  std::optional<ExposureKind> kind{};  ///< what lit the scene; empty: not known
};

/// Pixels that start at a multiple of this many bytes in memory go to the disk without a copy.
inline constexpr std::size_t kRawBlock = 4096;

struct RawFileOptions {
  std::uint64_t reserve_bytes = 64
                                << 20;  ///< room set aside on the disk ahead of the end; 0 = none
  bool discard = false;                 ///< checksums the frames but makes no file: for measuring
};

/// One camera's file: a header block (magic "SOLERAW1", format version, serial), then records of a
/// header block (magic, fields above, payload size, CRC-32 of header and payload) and 8-bit pixels,
/// each padded to 4096 bytes (docs/formats.md, byte by byte). Written as `<path>.partial` past the
/// page cache where the file system allows, fsynced and renamed by Close. When Append has returned,
/// the record survives the end of this process. A file that was cut anywhere can be scanned forward
/// to its last whole record.
class RawFileWriter {
 public:
  /// Throws Error if the file cannot be created or exists already, whole or .partial: recordings
  /// are never overwritten.
  RawFileWriter(const std::filesystem::path& path, const std::string& serial,
                const RawFileOptions& options = {});
  ~RawFileWriter();  ///< leaves the .partial file if Close was not called
  /// Returns the CRC-32 of the pixels. Throws Error if the disk is full or fails; earlier records
  /// stay readable.
  std::uint32_t Append(const RawRecordHeader& header, const std::uint8_t* pixels);
  /// Gives reserved room back, fsyncs and renames. Throws Error if that fails.
  void Close();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Where a record lies in its file.
struct RawRecord {
  RawRecordHeader header;
  std::uint64_t header_offset = 0;
  std::uint64_t payload_offset = 0;
  std::uint32_t payload_crc = 0;  ///< as the header says; ReadRawImage and CheckRawRecord compare
};

struct RawIndex {
  std::string serial;
  std::vector<RawRecord> records;
  std::uint64_t end = 0;            ///< where the next record would begin
  bool truncated = false;           ///< the file ends inside a record
  std::uint64_t skipped_bytes = 0;  ///< damaged bytes that the scan stepped over
};

/// The pixels of one record do not match their checksum, or the disk cannot read them.
class DamagedRecordError : public Error {
 public:
  using Error::Error;
};

/// Scans the headers. Throws Error with the path on a wrong magic or version; a torn tail sets
/// `truncated`.
RawIndex ReadRawIndex(const std::filesystem::path& path);
/// Reads the pixels of one record; throws DamagedRecordError with the path and trigger if they are
/// damaged, Error if the record is not there.
ImageU8 ReadRawImage(const std::filesystem::path& path, const RawRecord& record);
/// True if the record's pixels match their checksum.
bool CheckRawRecord(const std::filesystem::path& path, const RawRecord& record);

}  // namespace sole::io
