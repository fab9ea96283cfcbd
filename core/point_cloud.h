#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace sole {

/// Points of one trigger in the world frame. All vectors have the length of `points_m`, or are empty where
/// the producer does not know the quantity.
struct PointCloud {
  std::vector<Eigen::Vector3f> points_m;
  std::vector<Eigen::Vector3f> normals;   ///< unit, outwards (towards the cameras that saw the point)
  std::vector<float> sigma_m;             ///< standard deviation along the normal
  std::vector<float> intensity;           ///< grey level, 0 to 255
  std::vector<std::uint8_t> pair;         ///< index of the source stereo pair in the rig

  std::size_t Size() const { return points_m.size(); }
};

}  // namespace sole
