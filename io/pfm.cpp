#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <sstream>

#include "core/error.h"
#include "io/pfm_internal.h"

namespace sole::io {
namespace {

float FloatAt(const char* bytes, bool little) {
  std::uint32_t word = 0;
  for (unsigned i = 0; i < 4; ++i) {
    const unsigned shift = 8 * (little ? i : 3 - i);
    word |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[i])) << shift;
  }
  return std::bit_cast<float>(word);
}

}  // namespace

bool IsPfm(const std::string& content) {
  return content.size() > 3 && content[0] == 'P' && (content[1] == 'f' || content[1] == 'F') &&
         (content[2] == '\n' || content[2] == ' ' || content[2] == '\r');
}

ImageF DecodePfm(const std::string& content, const std::string& where) {
  std::istringstream header(content.substr(0, 128));
  std::string magic;
  long width = 0, height = 0;
  double scale = 0;
  header >> magic >> width >> height >> scale;
  Require(header.good() && width > 0 && height > 0 && width <= 65536 && height <= 65536 &&
              scale != 0,
          where + ": the header is not that of a PFM image (Pf, width, height, scale)");
  const auto start = static_cast<std::size_t>(header.tellg()) + 1;  // one white space
  const std::size_t channels = magic == "PF" ? 3 : 1;
  const auto w = static_cast<std::size_t>(width), h = static_cast<std::size_t>(height);
  Require(content.size() == start + w * h * channels * 4,
          where + ": is " + std::to_string(content.size()) + " bytes long, its header asks for " +
              std::to_string(start + w * h * channels * 4) + ": the file is damaged");
  ImageF image(static_cast<int>(width), static_cast<int>(height));
  const bool little = scale < 0;
  for (std::size_t y = 0; y < h; ++y) {
    const char* row = content.data() + start + (h - 1 - y) * w * channels * 4;
    for (std::size_t x = 0; x < w; ++x) {
      const char* at = row + x * channels * 4;
      image.pixels[y * w + x] =
          channels == 1 ? FloatAt(at, little)
                        : 0.299F * FloatAt(at, little) + 0.587F * FloatAt(at + 4, little) +
                              0.114F * FloatAt(at + 8, little);
    }
  }
  return image;
}

std::string EncodePfm(const ImageF& image) {
  static_assert(std::endian::native == std::endian::little);
  std::string content = "Pf\n" + std::to_string(image.width) + " " +
                        std::to_string(image.height) + "\n-1.0\n";
  for (int y = image.height - 1; y >= 0; --y) {
    for (float value : image.Row(y)) {
      if (!std::isfinite(value)) value = std::numeric_limits<float>::infinity();
      char bytes[4];
      std::memcpy(bytes, &value, 4);
      content.append(bytes, 4);
    }
  }
  return content;
}

}  // namespace sole::io
