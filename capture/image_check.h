#pragma once

#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "capture/take_finding.h"
#include "core/frame_set.h"
#include "core/rig_config.h"

namespace sole::capture {

/// Bounds that separate healthy images from sick ones; docs/faults.md says where they come from.
struct ImageCheckOptions {
  double max_dark_level = 20;        ///< 10th percentile; above it the room's lights are on
  double max_saturated = 0.02;       ///< share of the image
  double repeat_saturated = 0.10;
  double min_lit = 0.02;             ///< share of the image that shows dots
  double min_focus_ratio = 0.8;      ///< of a camera's focus to its partner's
  double repeat_focus_ratio = 0.7;
  double max_hot = 5e-5;             ///< share of pixels that are always saturated and alone
  double repeat_hot = 0.01;
  double min_light_ratio = 0.88;     ///< against the reference, 20th percentile over what did not move
};

/// Medians over the frames with speckle light, except `hot`, which all frames tell.
struct ImageFigures {
  std::string serial;
  int frames = 0;
  double dark_level = 0;
  double saturated = 0;
  double lit = 0;
  double contrast = 0;
  double focus = 0;
  double hot = 0;  ///< share of pixels
  double light_ratio = std::numeric_limits<double>::quiet_NaN();  ///< NaN: no reference
  bool foot = false;  ///< in any frame
};

struct ImageCheckResult {
  std::vector<ImageFigures> cameras;  ///< rig order
  std::vector<TakeFinding> findings;
};

/// Judges some frame sets of a take by their pixels: lights on, over- and under-exposure, blur or
/// fog (against the other camera of the pair), hot pixels, and whether a foot is in view of the
/// cameras below the plate (of any camera if none is below). `reference`, a frame set of an earlier
/// good take, adds whether less light comes from the projectors; only parts of the picture that
/// are the same in both count, so another foot does no harm. Frames with texture light tell only
/// saturation and hot pixels.
ImageCheckResult CheckImages(const RigConfig& config, std::span<const FrameSet> sets,
                             const FrameSet* reference = nullptr,
                             const ImageCheckOptions& options = {});

/// Share of pixels that are saturated in every image while their neighbours are not.
double HotPixelShare(std::span<const ImageU8* const> images);

/// Brightness of `image` over that of `reference`, 20th percentile over the parts that both show
/// alike; NaN if there are too few, or if the picture itself moved.
double LightRatio(const ImageU8& reference, const ImageU8& image);

}  // namespace sole::capture
