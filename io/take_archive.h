#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>

namespace sole::io {

struct TakeArchiveOptions {
  std::filesystem::path out{};  ///< another take made of the result; empty: beside the source files
  bool delete_source = false;   ///< deletes each camera's source file once all results are verified
  int threads = 0;              ///< 0: all cores
  std::function<void(std::int64_t done, std::int64_t total)> progress{};  ///< frames, any thread
  const std::atomic<bool>* stop = nullptr;  ///< ends with an Error; repeating goes on from there
};

struct TakeArchiveResult {
  std::int64_t records = 0;
  std::uint64_t raw_bytes = 0;
  std::uint64_t archive_bytes = 0;
  int deleted = 0;  ///< source files
};

/// Compresses every camera's raw file of a closed take to cameras/SERIAL.mkv (io/raw_archive.h) and
/// verifies the results by reading them back. Throws Error if the take needs recovery.
TakeArchiveResult ArchiveTake(const std::filesystem::path& directory,
                              const TakeArchiveOptions& options = {});

/// Writes the raw files again that the archives were made from, byte for byte.
TakeArchiveResult RestoreTake(const std::filesystem::path& directory,
                              const TakeArchiveOptions& options = {});

}  // namespace sole::io
