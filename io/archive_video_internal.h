#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/image.h"

// FFV1 in Matroska through libavformat and libavcodec, which stay in archive_video.cpp.
namespace sole::io {

struct VideoFormat {
  int width = 0;
  int height = 0;
  double rate_hz = 10;
  std::string attachment;       ///< bytes kept in the file beside the frames
  std::string attachment_name;  ///< as players list it
};

/// Writes 8-bit grey frames. Throws Error naming the path.
class VideoWriter {
 public:
  VideoWriter(const std::filesystem::path& path, const VideoFormat& format);
  ~VideoWriter();
  void Append(const std::uint8_t* pixels);
  void Close();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Reads them. Throws Error naming the path if the file is none that VideoWriter writes.
class VideoReader {
 public:
  explicit VideoReader(const std::filesystem::path& path);
  ~VideoReader();
  const VideoFormat& Format() const;
  /// The next frame; empty at the end. Throws Error for a damaged one.
  std::optional<ImageU8> Next();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace sole::io
