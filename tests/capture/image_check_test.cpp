#include "capture/image_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "capture/image_sample.h"

namespace sole::capture {
namespace {

using ::testing::Contains;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Dots of about 4 px on a dark ground, within the box (left, top, right, bottom).
ImageU8 Dots(unsigned seed, int left, int top, int right, int bottom, double gain = 1) {
  ImageF image(640, 480, 5);
  std::mt19937 engine(seed);
  std::uniform_int_distribution<int> x(left + 4, right - 5), y(top + 4, bottom - 5);
  const int count = (right - left) * (bottom - top) / 25;
  for (int i = 0; i < count; ++i) {
    const int cx = x(engine), cy = y(engine);
    for (int dy = -3; dy <= 3; ++dy)
      for (int dx = -3; dx <= 3; ++dx)
        image.At(cx + dx, cy + dy) +=
            static_cast<float>(gain * 90 * std::exp(-0.5 * (dx * dx + dy * dy) / 1.7));
  }
  ImageU8 levels(640, 480);
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    levels.pixels[i] = static_cast<std::uint8_t>(std::min(240.0f, image.pixels[i]));
  return levels;
}

ImageU8 Foot(unsigned seed, double gain = 1) { return Dots(seed, 120, 120, 480, 330, gain); }

/// What fog or stray light makes of it.
ImageU8 Mixed(const ImageU8& image, double share, double level) {
  ImageU8 mixed = image;
  for (auto& p : mixed.pixels) p = static_cast<std::uint8_t>((1 - share) * p + level);
  return mixed;
}

/// Two pairs, the first below the plate.
struct Rig {
  RigConfig config = MakeDefaultRig(4, 640, 480);
  std::vector<FrameSet> sets;
  Rig() {
    for (unsigned t = 0; t < 3; ++t) {
      FrameSet set;
      set.trigger = t + 1;
      for (unsigned c = 0; c < 4; ++c) set.images.push_back(Foot(10 * t + c));
      sets.push_back(set);
    }
  }
  template <typename F>
  void Change(std::size_t camera, F change) {
    for (FrameSet& set : sets) set.images[camera] = change(*set.images[camera]);
  }
  std::vector<TakeFinding> Findings(const FrameSet* reference = nullptr) const {
    return CheckImages(config, sets, reference).findings;
  }
};

auto Reason(const std::string& text) { return Field(&TakeFinding::reason, HasSubstr(text)); }

TEST(CheckImages, HealthyImagesAreNotBlamed) {
  const Rig rig;
  EXPECT_THAT(rig.Findings(), IsEmpty());
  const auto figures = CheckImages(rig.config, rig.sets).cameras;
  ASSERT_EQ(figures.size(), 4u);
  EXPECT_EQ(figures[2].serial, rig.config.cameras[2].serial);
  EXPECT_EQ(figures[0].frames, 3);
  EXPECT_NEAR(figures[0].dark_level, 5, 1);
  EXPECT_TRUE(std::isnan(figures[0].light_ratio));
}

TEST(CheckImages, FoggedCameraIsNamedAndLightsAreOn) {
  Rig fogged;
  fogged.Change(1, [](const ImageU8& image) { return Mixed(image, 0.5, 15); });
  const auto findings = fogged.Findings();
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_THAT(findings[0].reason, HasSubstr("camera SIM0002 is blurred or fogged"));
  EXPECT_TRUE(findings[0].repeat);

  Rig lit;
  for (std::size_t c = 0; c < 4; ++c)
    lit.Change(c, [](const ImageU8& image) { return Mixed(image, 0.2, 40); });
  EXPECT_THAT(lit.Findings(), Contains(Reason("lights are on")));
  EXPECT_EQ(lit.Findings().size(), 1u);
}

TEST(CheckImages, HotPixelsOverexposureAndDarknessAreNamed) {
  Rig rig;
  rig.Change(0, [](ImageU8 image) {
    std::mt19937 engine(1);  // the same in every image
    for (int i = 0; i < 300; ++i) image.pixels[engine() % image.pixels.size()] = 255;
    return image;
  });
  rig.Change(2, [](ImageU8 image) {
    for (auto& p : image.pixels) p = p > 60 ? 255 : p;
    return image;
  });
  rig.Change(3, [](const ImageU8&) { return ImageU8(640, 480, 4); });
  const auto findings = rig.Findings();
  EXPECT_THAT(findings, Contains(Field(&TakeFinding::reason, ::testing::MatchesRegex("camera SIM0001: 0.0[89].* % of the pixels are stuck.*"))));
  EXPECT_THAT(findings, Contains(Reason("camera SIM0003: ")));
  EXPECT_THAT(findings, Contains(Reason("of the image saturated")));
  EXPECT_THAT(findings, Contains(Reason("camera SIM0004 sees no dots")));
}

TEST(CheckImages, PlateWithoutFootIsTold) {
  Rig rig;
  for (std::size_t c = 0; c < 2; ++c) {  // below: two fiducials
    rig.Change(c, [](const ImageU8&) {
      ImageU8 image = Dots(3, 20, 20, 60, 60);
      const ImageU8 other = Dots(4, 500, 400, 620, 440);
      for (std::size_t i = 0; i < image.pixels.size(); ++i)
        image.pixels[i] = std::max(image.pixels[i], other.pixels[i]);
      return image;
    });
  }
  EXPECT_THAT(rig.Findings(), Contains(Reason("no foot on the plate")));
}

TEST(CheckImages, LessLightThanInTheReferenceIsAProjector) {
  Rig rig;
  const FrameSet reference = rig.sets[0];
  EXPECT_THAT(rig.Findings(&reference), IsEmpty());
  Rig dim;
  for (FrameSet& set : dim.sets) {
    set = reference;
    for (std::size_t c = 0; c < 2; ++c) set.images[c] = Foot(static_cast<unsigned>(c), 0.7);
  }
  const auto findings = dim.Findings(&reference);
  ASSERT_EQ(findings.size(), 1u);
  EXPECT_THAT(findings[0].reason, HasSubstr("projector is dark or weak"));
  EXPECT_THAT(findings[0].reason, HasSubstr("SIM0001"));
  EXPECT_THAT(findings[0].reason, HasSubstr("SIM0002"));
  EXPECT_EQ(findings[0].reason.find("SIM0003"), std::string::npos);
}

TEST(CheckImages, TextureLightTellsNothingAboutDots) {
  Rig rig;
  for (FrameSet& set : rig.sets) {
    set.kind = ExposureKind::kTexture;
    for (auto& image : set.images) image = ImageU8(640, 480, 90);
  }
  EXPECT_THAT(rig.Findings(), IsEmpty());
}

TEST(LightRatio, MovedPictureHasNone) {
  const ImageU8 a = Foot(1);
  ImageU8 moved = a;
  for (int y = 0; y < 480; ++y)
    for (int x = 0; x < 638; ++x) moved.At(x, y) = a.At(x + 2, y);
  EXPECT_NEAR(LightRatio(a, a), 1, 1e-9);
  EXPECT_TRUE(std::isnan(LightRatio(a, Foot(2)))) << "nothing alike";
}

TEST(SampleImage, TellsLevelsAndLitRegions) {
  const ImageSample sample = SampleImage(640, 480, Foot(7).pixels);
  // The box covers 360 x 210 of 640 x 480 pixels.
  EXPECT_NEAR(sample.largest_lit, 360.0 * 210 / (640 * 480), 0.05);
  EXPECT_TRUE(FootInView(sample));
  EXPECT_FALSE(FootInView(SampleImage(640, 480, Dots(1, 20, 20, 90, 90).pixels)));
  const ImageU8 flat(320, 200, 77);
  const ImageSample grey = SampleImage(320, 200, flat.pixels);
  EXPECT_EQ(grey.mean, 77);
  EXPECT_EQ(grey.dark_level, 77);
  EXPECT_EQ(grey.lit, 0);
  EXPECT_EQ(MotionBetween(grey, SampleImage(320, 200, ImageU8(320, 200, 80).pixels)), 3);
  EXPECT_TRUE(SampleImage(640, 480, flat.pixels).levels.empty()) << "too few pixels";
}

}  // namespace
}  // namespace sole::capture
