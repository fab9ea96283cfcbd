#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace sole::capture {

/// What a sparse look at one image tells; cheap enough for every frame of every camera. The image is
/// divided into square blocks, forty to the longer side, and every block is looked at in 8 x 8
/// points. A block is lit where its levels vary: dots or edges, no plain dark background.
struct ImageSample {
  std::vector<std::uint8_t> levels;  ///< of all points, for MotionBetween
  double mean = 0;                   ///< grey level
  double dark_level = 0;   ///< 10th percentile of the levels: what the background looks like
  double saturated = 0;    ///< share of points at 250 or more
  double lit = 0;          ///< share of blocks
  double largest_lit = 0;  ///< share of blocks in the largest connected lit region
  double contrast = 0;     ///< median over lit blocks of standard deviation / mean
  double focus = 0;  ///< median over lit blocks of |difference of neighbours two apart| / mean: falls
                     ///< with blur, fog and stray light
};

/// `pixels` holds width * height bytes, at least 64 each way; a shorter span gives an empty sample.
ImageSample SampleImage(int width, int height, std::span<const std::uint8_t> pixels);

/// Mean absolute difference of two samples of one camera, grey levels; 0 if their sizes differ.
double MotionBetween(const ImageSample& a, const ImageSample& b);

/// Whether something as large as part of a foot is in view: a lit region above 4 % of the image,
/// which no fiducial reaches.
bool FootInView(const ImageSample& sample);

}  // namespace sole::capture
