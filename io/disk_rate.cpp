#include "io/disk_rate.h"

#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "core/error.h"
#include "io/raw_file.h"

namespace sole::io {

namespace fs = std::filesystem;

namespace {

using Clock = std::chrono::steady_clock;

double SecondsSince(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

/// One frame of noise, so that no file system compresses it, at a multiple of kRawBlock.
std::shared_ptr<std::uint8_t> NoiseFrame(std::size_t bytes) {
  std::shared_ptr<std::uint8_t> frame(static_cast<std::uint8_t*>(std::aligned_alloc(
                                          kRawBlock, (bytes / kRawBlock + 1) * kRawBlock)),
                                      std::free);
  if (!frame) throw std::bad_alloc();
  std::uint32_t state = 1;
  for (std::size_t i = 0; i < bytes; ++i) {
    state = state * 1664525U + 1013904223U;
    frame.get()[i] = static_cast<std::uint8_t>(state >> 24);
  }
  return frame;
}

}  // namespace

double MeasureWriteRate(const fs::path& directory, const WriteRateOptions& options) {
  Require(options.files >= 1 && options.frame_bytes >= kRawBlock && options.max_seconds > 0,
          "a write test needs a file, frames of 4096 bytes or more and some time");
  std::error_code error;
  const fs::space_info space = fs::space(directory, error);
  Require(!error, "cannot write to " + directory.string() + ": " + error.message());
  const std::uint64_t total =
      std::min<std::uint64_t>(options.max_bytes, error ? options.max_bytes : space.available / 10);
  const std::uint64_t frames = std::max<std::uint64_t>(
      1, total / options.frame_bytes / static_cast<std::uint64_t>(options.files));
  const std::shared_ptr<std::uint8_t> pixels = NoiseFrame(options.frame_bytes);
  const RawRecordHeader header{
      .width = static_cast<std::uint32_t>(kRawBlock),
      .height = static_cast<std::uint32_t>(options.frame_bytes / kRawBlock)};
  std::vector<fs::path> paths;
  for (int i = 0; i < options.files; ++i) {
    paths.push_back(directory /
                    (".write-test" + std::to_string(getpid()) + "-" + std::to_string(i)));
  }
  std::vector<std::exception_ptr> failures(paths.size());
  std::atomic<std::uint64_t> written{0};
  const Clock::time_point begin = Clock::now();
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    threads.emplace_back([&, i] {
      try {
        RawFileWriter writer(paths[i], "test");
        for (std::uint64_t n = 0; n < frames && SecondsSince(begin) < options.max_seconds; ++n) {
          writer.Append(header, pixels.get());
          written += options.frame_bytes;
        }
        writer.Close();
      } catch (...) {
        failures[i] = std::current_exception();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  const double seconds = SecondsSince(begin);
  for (const fs::path& path : paths) {
    fs::remove(path, error);
    fs::remove(path.string() + ".partial", error);
  }
  for (const std::exception_ptr& failure : failures) {
    if (failure) std::rethrow_exception(failure);
  }
  return static_cast<double>(written.load()) / seconds;
}

}  // namespace sole::io
