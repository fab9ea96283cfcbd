#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "core/error.h"
#include "io/atomic_file.h"
#include "io/image_file.h"
#include "io/pfm_internal.h"

namespace sole::io {
namespace {

template <typename T>
double GreyOf(const T* pixel, int channels) {
  if (channels < 3) return static_cast<double>(pixel[0]);
  return 0.114 * static_cast<double>(pixel[0]) + 0.587 * static_cast<double>(pixel[1]) +
         0.299 * static_cast<double>(pixel[2]);
}

template <typename T>
ImageF ToGrey(const cv::Mat& decoded) {
  ImageF grey(decoded.cols, decoded.rows);
  for (int y = 0; y < decoded.rows; ++y) {
    const T* row = decoded.ptr<T>(y);
    for (int x = 0; x < decoded.cols; ++x) {
      grey.At(x, y) =
          static_cast<float>(GreyOf(row + static_cast<std::ptrdiff_t>(x) * decoded.channels(),
                                    decoded.channels()));
    }
  }
  return grey;
}

cv::Mat Decode(const std::string& content) {
  if (content.empty()) return {};
  try {
    const cv::Mat bytes(1, static_cast<int>(content.size()), CV_8UC1,
                        const_cast<char*>(content.data()));
    return cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    return {};
  }
}

std::string EncodeTiff(const ImageF& image) {
  ImageF marked = image;
  for (float& value : marked.pixels) {
    if (!std::isfinite(value)) value = std::numeric_limits<float>::quiet_NaN();
  }
  const cv::Mat pixels(marked.height, marked.width, CV_32F, marked.pixels.data());
  std::vector<std::uint8_t> encoded;
  const bool good = cv::imencode(".tiff", pixels, encoded, {cv::IMWRITE_TIFF_COMPRESSION, 1});
  Require(good, "an image of " + std::to_string(image.width) + " x " +
                    std::to_string(image.height) + " pixels cannot be written as TIFF");
  return {encoded.begin(), encoded.end()};
}

bool HasExtension(const std::filesystem::path& path, std::initializer_list<const char*> known) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return std::find(known.begin(), known.end(), extension) != known.end();
}

}  // namespace

GreyImage ReadGreyImage(const std::filesystem::path& path) {
  const std::string content = ReadFile(path);
  GreyImage image;
  if (IsPfm(content)) {
    image = {DecodePfm(content, path.string()), 32};
  } else {
    const cv::Mat decoded = Decode(content);
    switch (decoded.empty() ? -1 : decoded.depth()) {
      case CV_8U: image = {ToGrey<std::uint8_t>(decoded), 8}; break;
      case CV_16U: image = {ToGrey<std::uint16_t>(decoded), 16}; break;
      case CV_32F: image = {ToGrey<float>(decoded), 32}; break;
      case CV_64F: image = {ToGrey<double>(decoded), 32}; break;
      default:
        throw Error(path.string() +
                    ": is not an image that can be read: save it as 8 or 16 bit PNG, TIFF or PFM");
    }
  }
  Require(std::all_of(image.grey.pixels.begin(), image.grey.pixels.end(),
                      [](float value) { return std::isfinite(value); }),
          path.string() + ": has pixels that are not finite numbers: an image to match needs a grey "
                          "level everywhere");
  return image;
}

double WhiteLevel(std::span<const GreyImage> images) {
  int bits = 8;
  float largest = 0;
  for (const GreyImage& image : images) {
    bits = std::max(bits, image.bits);
    for (const float value : image.grey.pixels) largest = std::max(largest, value);
  }
  if (bits == 8) return 255;
  const std::vector<double> levels = bits == 16 ? std::vector<double>{1023, 4095, 16383, 65535}
                                                : std::vector<double>{1, 255, 65535};
  for (const double level : levels) {
    if (static_cast<double>(largest) <= level) return level;
  }
  return static_cast<double>(largest);
}

void CheckFloatImageExtension(const std::filesystem::path& path) {
  Require(HasExtension(path, {".pfm", ".tif", ".tiff"}),
          path.string() + ": disparity is not written with extension '" +
              path.extension().string() + "': use .tiff or .pfm");
}

void WriteFloatImage(const std::filesystem::path& path, const ImageF& image) {
  CheckFloatImageExtension(path);
  Require(!image.Empty(), path.string() + ": an empty image cannot be written");
  WriteStringAtomically(path,
                        HasExtension(path, {".pfm"}) ? EncodePfm(image) : EncodeTiff(image));
}

}  // namespace sole::io
