#pragma once

#include <cstdint>
#include <filesystem>

namespace sole::io {

struct WriteRateOptions {
  int files = 1;                      ///< written side by side, as a recorder does
  std::size_t frame_bytes = 2 << 20;  ///< of each write
  std::uint64_t max_bytes =
      512 << 20;  ///< all files together; also at most a tenth of the free room
  double max_seconds = 1.0;
};

/// What the disk below `directory` takes, in bytes a second, written as recordings are: past the
/// page cache, fsynced within the time. The files are removed again. Throws Error if the directory
/// cannot be written to.
double MeasureWriteRate(const std::filesystem::path& directory,
                        const WriteRateOptions& options = {});

}  // namespace sole::io
