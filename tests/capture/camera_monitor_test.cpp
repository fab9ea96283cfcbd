#include "capture/camera_monitor.h"

#include <gtest/gtest.h>

#include <random>

namespace sole::capture {
namespace {

TEST(ClockFit, RateIsFoundUnderTriggerJitter) {
  std::mt19937 engine(3);
  std::normal_distribution<double> jitter_us(0, 50);
  ClockFit fit;
  constexpr std::int64_t kStart = 1'700'000'000'000'000'000;
  for (int i = 0; i < 100; ++i) {
    const double t = 0.1 * i;
    fit.Add(kStart + static_cast<std::int64_t>(1e9 * t),
            static_cast<std::uint64_t>(5'000'000'000 + 1e9 * t * (1 + 80e-6) +
                                       1e3 * jitter_us(engine)));
  }
  const auto rate = fit.Rate();
  ASSERT_TRUE(rate);
  // Standard error of a slope: 50 us / (2.9 s * sqrt(100)).
  EXPECT_NEAR(rate->sd_ppm, 50 / (2.887 * 10), 0.4);
  EXPECT_NEAR(rate->ppm, 80, 5 * rate->sd_ppm);
  EXPECT_EQ(rate->frames, 100);
}

TEST(ClockFit, FewFramesTellNothing) {
  ClockFit fit;
  for (int i = 0; i < 4; ++i) fit.Add(i, static_cast<std::uint64_t>(i));
  EXPECT_FALSE(fit.Rate());
}

/// A frame of a uniform grey that arrives `latency_ms` after its edge.
void Feed(CameraMonitor& monitor, std::int64_t trigger, std::uint8_t level, ExposureKind kind,
          double latency_ms, bool complete = true) {
  static std::vector<std::uint8_t> pixels;
  pixels.assign(128 * 96, level);
  CameraFrame frame;
  frame.width = 128;
  frame.height = 96;
  frame.complete = complete;
  frame.pixels = pixels;
  frame.device_time_ns = static_cast<std::uint64_t>(trigger) * 100'000'000;
  frame.host_time_ns =
      trigger * 100'000'000 + static_cast<std::int64_t>(latency_ms * 1e6);
  FrameMatch match;
  match.edge = {trigger, kind, trigger * 100'000'000, trigger * 100'000'000};
  monitor.OnFrame(frame, match);
}

TEST(CameraMonitor, MotionComparesImagesOfTheSameLight) {
  CameraMonitor monitor;
  Feed(monitor, 1, 10, ExposureKind::kSpeckle, 5);
  Feed(monitor, 2, 200, ExposureKind::kTexture, 5);
  Feed(monitor, 3, 14, ExposureKind::kSpeckle, 5);
  Feed(monitor, 4, 207, ExposureKind::kTexture, 5);
  EXPECT_EQ(monitor.Motion(), (std::map<std::int64_t, double>{{3, 4}, {4, 7}}));
}

TEST(CameraMonitor, LatencyIsTheMedianAndHolesCountForIt) {
  CameraMonitor monitor;
  for (int i = 1; i <= 9; ++i) {
    Feed(monitor, i, 10, ExposureKind::kSpeckle, i == 5 ? 900 : 20 + i, i != 3);
  }
  EXPECT_NEAR(monitor.MedianLatencyS(), 0.026, 1e-6);
  EXPECT_EQ(monitor.Now().whole_frames, 8);
  monitor.Restart();
  EXPECT_EQ(monitor.MedianLatencyS(), 0);
  EXPECT_TRUE(monitor.Motion().empty());
}

TEST(CameraMonitor, PicturesAreKeptOnlyIfAskedForAndNotMoreOftenThanThat) {
  CameraMonitor monitor;
  Feed(monitor, 1, 10, ExposureKind::kSpeckle, 5);
  EXPECT_TRUE(monitor.Picture().Empty());
  monitor.KeepPictures(0.25);
  for (int i = 2; i <= 4; ++i) Feed(monitor, i, static_cast<std::uint8_t>(10 * i), ExposureKind::kSpeckle, 5);
  EXPECT_EQ(monitor.Picture().At(5, 5), 20);
  Feed(monitor, 5, 50, ExposureKind::kSpeckle, 5);
  EXPECT_EQ(monitor.Picture().At(5, 5), 50);
}

}  // namespace
}  // namespace sole::capture
