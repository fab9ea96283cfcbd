#include "capture/image_check.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "capture/image_sample.h"

namespace sole::capture {
namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return kNone;
  const auto at = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1) + 0.5);
  std::nth_element(values.begin(), values.begin() + at, values.end());
  return values[static_cast<std::size_t>(at)];
}

std::string Text(const char* format, double value) {
  char text[48];
  std::snprintf(text, sizeof text, format, value);
  return text;
}
std::string Percent(double share) { return Text("%.2g %%", 100 * share); }

ImageFigures FiguresOf(std::span<const FrameSet> sets, std::size_t camera) {
  ImageFigures figures;
  std::vector<const ImageU8*> all;
  std::vector<double> dark, saturated, lit, contrast, focus, any_saturated;
  for (const FrameSet& set : sets) {
    if (camera >= set.images.size() || !set.images[camera]) continue;
    const ImageU8& image = *set.images[camera];
    all.push_back(&image);
    const ImageSample sample = SampleImage(image.width, image.height, image.pixels);
    any_saturated.push_back(sample.saturated);
    if (set.kind != ExposureKind::kSpeckle) continue;
    dark.push_back(sample.dark_level);
    saturated.push_back(sample.saturated);
    lit.push_back(sample.lit);
    contrast.push_back(sample.contrast);
    focus.push_back(sample.focus);
    figures.foot = figures.foot || FootInView(sample);
  }
  figures.frames = static_cast<int>(dark.size());
  figures.saturated = all.empty() ? 0 : Quantile(saturated.empty() ? any_saturated : saturated, 0.5);
  figures.hot = HotPixelShare(all);
  if (dark.empty()) return figures;
  figures.dark_level = Quantile(dark, 0.5);
  figures.lit = Quantile(lit, 0.5);
  figures.contrast = Quantile(contrast, 0.5);
  figures.focus = Quantile(focus, 0.5);
  return figures;
}

/// Median brightness against the reference, over the sets.
double LightRatioOf(std::span<const FrameSet> sets, std::size_t camera, const FrameSet& reference) {
  if (camera >= reference.images.size() || !reference.images[camera]) return kNone;
  std::vector<double> ratios;
  for (const FrameSet& set : sets) {
    if (set.kind != reference.kind || camera >= set.images.size() || !set.images[camera]) continue;
    const double ratio = LightRatio(*reference.images[camera], *set.images[camera]);
    if (std::isfinite(ratio)) ratios.push_back(ratio);
  }
  return Quantile(ratios, 0.5);
}

class Judgement {
 public:
  Judgement(const RigConfig& config, const ImageCheckOptions& options, ImageCheckResult& result)
      : config_(config), options_(options), result_(result) {}

  void Run() {
    const bool speckle = std::any_of(Cameras().begin(), Cameras().end(),
                                     [](const ImageFigures& f) { return f.frames > 0; });
    const bool lights = speckle && JudgeLights();
    for (std::size_t i = 0; i < Cameras().size(); ++i) {
      JudgeSaturation(Cameras()[i]);
      JudgeHotPixels(Cameras()[i]);
      if (Cameras()[i].frames > 0) JudgeDots(i, lights);
    }
    if (speckle) JudgeFoot();
    JudgeProjectors();
  }

 private:
  std::vector<ImageFigures>& Cameras() { return result_.cameras; }
  void Add(bool repeat, const std::string& reason) { result_.findings.push_back({reason, repeat}); }

  /// The room's light reaches every camera; fog only its own.
  bool JudgeLights() {
    std::vector<double> levels, contrasts;
    std::size_t bright = 0;
    for (const ImageFigures& f : Cameras()) {
      if (f.frames == 0) continue;
      levels.push_back(f.dark_level);
      contrasts.push_back(f.contrast);
      bright += f.dark_level > options_.max_dark_level ? 1 : 0;
    }
    if (2 * bright <= levels.size()) return false;
    Add(Quantile(contrasts, 0.5) < 0.25,
        "the lights are on: the background has grey level " +
            Text("%.0f", Quantile(levels, 0.5)) + " and the dots are weak: darken the room");
    return true;
  }

  void JudgeSaturation(const ImageFigures& f) {
    if (f.saturated <= options_.max_saturated) return;
    Add(f.saturated > options_.repeat_saturated,
        "camera " + f.serial + ": " + Percent(f.saturated) +
            " of the image saturated: lower exposure_us or gain_db");
  }

  void JudgeHotPixels(const ImageFigures& f) {
    if (f.hot <= options_.max_hot) return;
    Add(f.hot > options_.repeat_hot,
        "camera " + f.serial + ": " + Percent(f.hot) +
            " of the pixels are stuck bright: lower gain_db, let it cool, have it checked");
  }

  /// Blur and fog show against the other cameras, first of all the pair's other one, which sees
  /// the same dots.
  void JudgeDots(std::size_t i, bool lights) {
    const ImageFigures& f = Cameras()[i];
    if (f.lit < options_.min_lit) {
      Add(true, "camera " + f.serial +
                    " sees no dots: is the lens capped, or does no projector reach its view?");
      return;
    }
    double best = 0;
    for (const PairConfig& pair : config_.pairs) {
      const std::string* other = pair.left == f.serial    ? &pair.right
                                 : pair.right == f.serial ? &pair.left
                                                          : nullptr;
      if (other == nullptr) continue;
      const ImageFigures& partner =
          Cameras()[static_cast<std::size_t>(CameraIndex(config_, *other))];
      if (partner.frames > 0) best = std::max(best, partner.focus);
    }
    if (best > 0 && f.focus < options_.min_focus_ratio * best) {
      Add(f.focus < options_.repeat_focus_ratio * best,
          "camera " + f.serial + " is blurred or fogged: its dots have " +
              Text("%.0f %%", 100 * f.focus / best) +
              " of the sharpness of its pair's other camera: wipe the lens, check the focus");
    } else if (!lights && f.contrast < 0.3) {
      Add(true, "camera " + f.serial + " sees dots of low contrast (" + Text("%.2f", f.contrast) +
                    "): check lenses, focus and projectors");
    }
  }

  void JudgeFoot() {
    bool any_below = false, seen_below = false, seen = false;
    for (std::size_t i = 0; i < Cameras().size(); ++i) {
      const bool below = config_.cameras[i].position_m.z() < 0;
      any_below = any_below || (below && Cameras()[i].frames > 0);
      seen_below = seen_below || (below && Cameras()[i].foot);
      seen = seen || Cameras()[i].foot;
    }
    if (any_below ? seen_below : seen) return;
    Add(true, any_below ? "no foot on the plate: the cameras below it see none"
                        : "no foot in view of any camera");
  }

  void JudgeProjectors() {
    std::string darker;
    for (const ImageFigures& f : Cameras()) {
      if (!(f.light_ratio < options_.min_light_ratio) || Fogged(f)) continue;
      darker += (darker.empty() ? "" : ", ") + f.serial + " (" +
                Text("%.0f %%", 100 * f.light_ratio) + ")";
    }
    if (darker.empty()) return;
    Add(true, "a projector is dark or weak: less light than in the reference take at camera " +
                  darker + ": check lamps and strobe cables");
  }

  bool Fogged(const ImageFigures& f) const {
    const std::string name = "camera " + f.serial + " is blurred";
    return std::any_of(result_.findings.begin(), result_.findings.end(),
                       [&](const TakeFinding& finding) { return finding.reason.starts_with(name); });
  }

  const RigConfig& config_;
  const ImageCheckOptions& options_;
  ImageCheckResult& result_;
};

}  // namespace

double HotPixelShare(std::span<const ImageU8* const> images) {
  constexpr int kHot = 250, kStep = 100;
  if (images.empty()) return 0;
  const int width = images[0]->width, height = images[0]->height;
  const auto hot_in = [&](const ImageU8& image, int x, int y) {
    if (image.width != width || image.height != height) return true;
    const int level = image.At(x, y);
    if (level < kHot) return false;
    int sum = 0;
    for (int j = y - 1; j <= y + 1; ++j)
      for (int i = x - 1; i <= x + 1; ++i) sum += image.At(i, j);
    return (sum - level) / 8 < level - kStep;
  };
  std::int64_t hot = 0;
  for (int y = 1; y + 1 < height; ++y) {
    for (int x = 1; x + 1 < width; ++x) {
      hot += std::all_of(images.begin(), images.end(),
                         [&](const ImageU8* image) { return hot_in(*image, x, y); })
                 ? 1
                 : 0;
    }
  }
  return static_cast<double>(hot) / (static_cast<double>(width) * height);
}

double LightRatio(const ImageU8& reference, const ImageU8& image) {
  constexpr int kBlocks = 40, kMinBlocks = 6;
  constexpr double kAlike = 0.6, kMoved = 1.08;
  if (reference.width != image.width || reference.height != image.height) return kNone;
  const int side = std::max(8, std::max(image.width, image.height) / kBlocks);
  std::vector<double> ratios;
  for (int top = 0; top + side <= image.height; top += side) {
    for (int left = 0; left + side <= image.width; left += side) {
      double a = 0, b = 0, aa = 0, bb = 0, ab = 0;
      for (int y = top; y < top + side; ++y) {
        for (int x = left; x < left + side; ++x) {
          const double p = reference.At(x, y), q = image.At(x, y);
          a += p;
          b += q;
          aa += p * p;
          bb += q * q;
          ab += p * q;
        }
      }
      const double n = static_cast<double>(side) * side;
      const double sa = std::sqrt(std::max(0.0, aa / n - a * a / n / n));
      const double sb = std::sqrt(std::max(0.0, bb / n - b * b / n / n));
      if (sa < 12 || sb < 8) continue;
      if ((ab / n - a * b / n / n) / (sa * sb) > kAlike) ratios.push_back(b / a);
    }
  }
  // A camera that moved sees some blocks brighter and some darker.
  if (static_cast<int>(ratios.size()) < kMinBlocks || Quantile(ratios, 0.8) > kMoved) return kNone;
  return Quantile(ratios, 0.2);
}

ImageCheckResult CheckImages(const RigConfig& config, std::span<const FrameSet> sets,
                             const FrameSet* reference, const ImageCheckOptions& options) {
  ImageCheckResult result;
  for (std::size_t i = 0; i < config.cameras.size(); ++i) {
    result.cameras.push_back(FiguresOf(sets, i));
    result.cameras.back().serial = config.cameras[i].serial;
    if (reference != nullptr) {
      result.cameras.back().light_ratio = LightRatioOf(sets, i, *reference);
    }
  }
  Judgement(config, options, result).Run();
  return result;
}

}  // namespace sole::capture
