#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <vector>

namespace sole::io {

/// Pixels from a CSV file with the header `x_px,y_px`. Throws Error with path and line.
std::vector<Eigen::Vector2d> ReadPixelList(const std::filesystem::path& path);

}  // namespace sole::io
