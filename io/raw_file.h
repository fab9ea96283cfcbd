#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

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
  std::uint32_t status = 0;  ///< 0 good; bit 0 incomplete
};

/// One camera's file: a 64-byte file header (magic "SOLERAW1", format version, serial), then
/// records of fixed-size header (magic, fields above, payload size, CRC-32 of header and payload)
/// and 8-bit pixels (docs/formats.md, byte by byte). Written as `<path>.partial`, fsynced and
/// renamed by Close. A file that was cut anywhere can be scanned forward to its last whole record.
class RawFileWriter {
 public:
  /// Throws Error if the file cannot be created or exists already, whole or .partial: recordings
  /// are never overwritten.
  RawFileWriter(const std::filesystem::path& path, const std::string& serial);
  ~RawFileWriter();  ///< leaves the .partial file if Close was not called
  /// Throws Error if the disk is full or fails; earlier records stay readable.
  void Append(const RawRecordHeader& header, const std::uint8_t* pixels);
  void Close();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Where a record lies in its file.
struct RawRecord {
  RawRecordHeader header;
  std::uint64_t payload_offset = 0;
};

struct RawIndex {
  std::string serial;
  std::vector<RawRecord> records;
  bool truncated = false;           ///< the file ends inside a record
  std::uint64_t skipped_bytes = 0;  ///< damaged bytes between records that the scan stepped over
};

/// Scans the headers. Throws Error with the path on a wrong magic or version; a torn tail sets
/// `truncated`.
RawIndex ReadRawIndex(const std::filesystem::path& path);
/// Reads the pixels of one record and checks its CRC; throws Error with the path and trigger.
ImageU8 ReadRawImage(const std::filesystem::path& path, const RawRecord& record);

}  // namespace sole::io
