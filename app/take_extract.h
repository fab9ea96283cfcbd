#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace sole::app {

struct ExtractOptions {
  std::filesystem::path out;         ///< gets SERIAL/000001.png
  std::string format = "png";        ///< png or tiff
  std::vector<std::string> cameras;  ///< serials; empty: all
  std::int64_t first = 1;            ///< triggers from here ...
  std::int64_t last = INT64_MAX;     ///< ... to here
  std::function<void(std::int64_t done, std::int64_t total)> progress;  ///< triggers
  const std::atomic<bool>* stop = nullptr;
};

struct ExtractResult {
  std::int64_t images = 0;  ///< written
  std::int64_t absent = 0;  ///< lost, incomplete or damaged ones: no file
};

/// Writes a take's images as files that other programs open, each under its camera's serial and its
/// trigger. Throws Error for a camera that the take does not have, an empty range, or if a file
/// cannot be written; every file that stands is whole.
ExtractResult ExtractTake(const std::filesystem::path& directory, const ExtractOptions& options);

}  // namespace sole::app
