#pragma once

#include <vector>

#include "core/frame_set.h"
#include "core/point_cloud.h"
#include "core/rig.h"

namespace sole::recon {

/// Grey level of the skin at every point of the cloud (0 to 255) in an exposure by even light: read
/// between the pixels of the left image of the point's pair, or of the right one where the left is
/// missing or does not show it; the cloud's own value where neither does. The foot is taken to be
/// where the cloud is, so one that moves between the two exposures is read beside the true place.
/// Throws Error if the exposure is none of texture, if its images are not the rig's or if the cloud
/// does not name its pairs.
std::vector<float> TextureIntensity(const PointCloud& cloud, const Rig& rig,
                                    const FrameSet& texture);

}  // namespace sole::recon
