#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/point_cloud.h"

namespace sole::app {

struct FeetOptions {
  double cell_m = 0.006;         ///< points of neighbouring cells belong together
  std::size_t min_points = 1000; ///< of a foot; smaller pieces go to the nearest one
  double attach_m = 0.06;        ///< pieces further from every foot than this are none of a foot's
  double foot_length_m = 0.34;   ///< parts whose common outline is no longer and no wider are one foot
  double foot_width_m = 0.14;
  double low_m = 0.06;           ///< the outline is that of the lowest points, up to here
  double step_m = 0.5;           ///< that a foot may move from one frame to the next
};

/// Clouds of one frame's feet, largest first. Parts that are connected, stand over each other or fit together into
/// one foot's outline are one; a part too large for one foot is cut upright where two feet are joined least. A cloud without a foot comes back as it is.
std::vector<PointCloud> SplitFeet(const PointCloud& cloud, const FeetOptions& options = {});

/// One foot while it is seen without a gap.
struct FootTrack {
  std::size_t first = 0;           ///< frame
  std::vector<PointCloud> clouds;  ///< from that frame on
  std::size_t points = 0;
  std::size_t End() const { return first + clouds.size(); }
};

/// Follows the feet of a take from frame to frame, by distance. In order of their first frames, the larger one first.
std::vector<FootTrack> TrackFeet(std::span<const PointCloud> clouds, const FeetOptions& options = {});

}  // namespace sole::app
