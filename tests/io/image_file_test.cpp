#include "io/image_file.h"

#include <cstdlib>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "io/atomic_file.h"
#include "tests/support/error_matcher.h"
#include "tests/support/temp_dir.h"

namespace sole::io {
namespace {

using testing::HasSubstr;
using testing_support::ErrorOf;
using testing_support::TempDir;

ImageU8 Gradient() {
  ImageU8 image(37, 23);
  for (int y = 0; y < 23; ++y) {
    for (int x = 0; x < 37; ++x) image.At(x, y) = static_cast<std::uint8_t>(5 * x + 2 * y);
  }
  return image;
}

TEST(Image, RoundTripsLosslessly) {
  const TempDir dir;
  for (const char* name : {"a.png", "a.tiff", "a.pgm"}) {
    WriteImage(dir / name, Gradient());
    const ImageU8 read = ReadImage(dir / name);
    EXPECT_EQ(read.width, 37) << name;
    EXPECT_EQ(read.height, 23) << name;
    EXPECT_EQ(read.pixels, Gradient().pixels) << name;
  }
}

TEST(Image, JpegStaysWithinAFewGreyLevels) {
  const TempDir dir;
  WriteImage(dir / "a.jpg", Gradient());
  const ImageU8 read = ReadImage(dir / "a.jpg");
  int worst = 0;
  for (std::size_t i = 0; i < read.pixels.size(); ++i)
    worst = std::max(worst, std::abs(read.pixels[i] - Gradient().pixels[i]));
  EXPECT_LE(worst, 6);
}

TEST(ReadImage, TurnsColourToGrey) {
  const TempDir dir;
  WriteStringAtomically(dir / "a.ppm",
                        std::string("P6\n2 1\n255\n") + std::string("\xff\xff\xff\x00\xff\x00", 6));
  const ImageU8 read = ReadImage(dir / "a.ppm");
  EXPECT_EQ(read.At(0, 0), 255);
  EXPECT_NEAR(read.At(1, 0), 0.587 * 255, 1);  // weight of green in luma
}

TEST(Image, ErrorsNameThePath) {
  const TempDir dir;
  WriteStringAtomically(dir / "a.png", "not an image");
  WriteStringAtomically(dir / "b.png", "");
  EXPECT_THAT(ErrorOf([&] { ReadImage(dir / "a.png"); }), HasSubstr("a.png: is not an image"));
  EXPECT_THAT(ErrorOf([&] { ReadImage(dir / "b.png"); }), HasSubstr("b.png: is not an image"));
  EXPECT_THAT(ErrorOf([&] { ReadImage(dir / "none.png"); }), HasSubstr("none.png: No such file"));
  EXPECT_THAT(ErrorOf([&] { WriteImage(dir / "a.xyz", Gradient()); }),
              HasSubstr("not written with extension '.xyz'"));
  EXPECT_THAT(ErrorOf([&] { WriteImage(dir / "a.png", {}); }), HasSubstr("an empty image"));
}

}  // namespace
}  // namespace sole::io
