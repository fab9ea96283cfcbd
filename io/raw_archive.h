#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "io/raw_file.h"

namespace sole::io {

struct ArchiveOptions {
  double rate_hz = 10;  ///< frames a second of the video; players show it at this speed
  std::function<void()> progress{};         ///< called for every frame that was read or written
  const std::atomic<bool>* stop = nullptr;  ///< ends with an Error that leaves no file
};

/// Compresses a raw file to FFV1 (lossless, version 3, a CRC in every slice) in Matroska, frame k
/// of the video being record k of the file. The headers travel as an attachment, so that
/// RestoreRawFile gives the file back to the byte. The result is read back and compared before it
/// gets its name. Throws Error if the raw file has any damage (recover it first), holds images of
/// several sizes, or cannot be written.
void ArchiveRawFile(const std::filesystem::path& raw, const std::filesystem::path& archive,
                    const ArchiveOptions& options = {});

/// Writes the raw file that an archive was made from, every record checked against its CRC. Throws
/// Error if the archive is damaged; then nothing is written.
void RestoreRawFile(const std::filesystem::path& archive, const std::filesystem::path& raw,
                    const ArchiveOptions& options = {});

/// What an archive holds, read without decoding a frame. Offsets of the records are 0.
RawIndex ReadArchiveIndex(const std::filesystem::path& archive);

/// Decodes every frame. `visit` gets the place of the record (from 0) and whether its pixels match
/// the CRC of its header. Throws Error if the archive ends early or is no archive.
void CheckArchive(const std::filesystem::path& archive,
                  const std::function<void(std::size_t record, bool holds)>& visit);

}  // namespace sole::io
