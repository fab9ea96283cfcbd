#include "io/image_file.h"

#include <opencv2/imgcodecs.hpp>

#include "core/error.h"
#include "io/atomic_file.h"

namespace sole::io {

ImageU8 ReadImage(const std::filesystem::path& path) {
  const std::string content = ReadFile(path);
  cv::Mat decoded;
  try {
    const cv::Mat bytes(1, static_cast<int>(content.size()), CV_8UC1,
                        const_cast<char*>(content.data()));
    if (!content.empty())
      decoded = cv::imdecode(bytes, cv::IMREAD_GRAYSCALE | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
    decoded.release();
  }
  Require(!decoded.empty() && decoded.type() == CV_8UC1,
          path.string() + ": is not an image that can be read: save it as PNG, JPEG or TIFF");
  ImageU8 image(decoded.cols, decoded.rows);
  for (int y = 0; y < decoded.rows; ++y)
    std::copy_n(decoded.ptr(y), decoded.cols, image.Row(y).begin());
  return image;
}

void WriteImage(const std::filesystem::path& path, const ImageU8& image) {
  Require(!image.Empty(), path.string() + ": an empty image cannot be written");
  std::vector<std::uint8_t> encoded;
  bool good = false;
  try {
    const cv::Mat pixels(image.height, image.width, CV_8UC1,
                         const_cast<std::uint8_t*>(image.pixels.data()));
    good = cv::imencode(path.extension().string(), pixels, encoded);
  } catch (const cv::Exception&) {
    good = false;
  }
  Require(good, path.string() + ": images are not written with extension '" +
                    path.extension().string() + "': use .png, .jpg or .tiff");
  WriteStringAtomically(path, std::string(encoded.begin(), encoded.end()));
}

}  // namespace sole::io
