#pragma once

#include <string>

#include "core/image.h"
#include "recon/rectify.h"

namespace sole::recon {

struct MatchOptions {
  int block_px = 5;        ///< odd, rectified pixels
  int uniqueness = 3;      ///< percent by which the best cost must win
  int min_region_px = 40;  ///< smaller islands of disparity are dropped
};

/// Start values for subset matching: semi-global matching of the rectified pair (OpenCV's SGBM,
/// three-way). Disparity in rectified pixels for every pixel of the rectified left image; NaN where
/// there is none.
ImageF InitialDisparity(const ImageU8& left, const ImageU8& right,
                        const Rectification& rectification, const MatchOptions& options = {});

/// Semi-global matching of a pair that is rectified already: right x = left x - disparity, with
/// disparities from `min_disparity` (any sign) to below min_disparity + `disparities` (a multiple
/// of 16). Pixels; NaN where there is none.
ImageF SemiGlobalDisparity(const ImageU8& left, const ImageU8& right, int min_disparity,
                           int disparities, const MatchOptions& options = {});

struct ForegroundOptions {
  int close_px = 6;              ///< dark gaps of the speckle up to twice this are filled
  double relative_level = 0.10;  ///< of the range from background to bright that counts as lit
  double min_rise = 6;           ///< grey levels a lit pixel stands above the background at least
  double dark_level = 16;        ///< an image whose brightest thousandth stays below is dark
  int saturated_level = 252;
  double max_saturated = 0.35;  ///< share of lit pixels
};

/// Lit parts of an image: what a projector hits. `problem` says in words why the image cannot be
/// used (dark, saturated), else it is empty.
struct Foreground {
  ImageU8 mask;  ///< 255 where lit
  std::string problem;
};
Foreground FindForeground(const ImageU8& image, const ForegroundOptions& options = {});

}  // namespace sole::recon
