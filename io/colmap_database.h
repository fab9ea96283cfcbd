#pragma once

#include <filesystem>

#include "io/colmap_model.h"

namespace sole::io {

/// Writes the SQLite database from which COLMAP's mapper starts: cameras (model OPENCV, whose focal
/// lengths count as known), images, pixels as keypoints and, for every two images that see
/// `min_matches` or more points in common, these as verified matches. Poses and positions of points
/// are not part of it. Image i of the model has id i + 1 and its keypoints the order of its pixels.
/// Atomic. Throws Error if a camera has a k3, which OPENCV has no place for, or an image a repeated
/// name or a camera that is not there.
void WriteColmapDatabase(const std::filesystem::path& path, const ColmapModel& model,
                         int min_matches = 8);

}  // namespace sole::io
